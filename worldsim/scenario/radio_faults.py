"""What an event may do to the radio besides changing its keys: partitions, jams, flapping links.

Jams and their bounds are the medium's own tables; what must hold between events is in ``course``.
"""

from collections.abc import Iterator
from typing import Annotated

from msgspec import Meta

from agent.config import Table
from agent.messages import AgentId
from netem.messages import Flap, FlapPeriod, PartitionKind

Group = Annotated[tuple[AgentId, ...], Meta(min_length=1, max_length=1000)]
Groups = Annotated[tuple[Group, ...], Meta(min_length=1, max_length=1000)]
Pair = tuple[AgentId, AgentId]


class PartitionTable(Table, frozen=True):
    """A partition of some kind; agents that no group names form one more.

    clean: a group hears only itself. one_way: a group hears all, and is heard by itself alone.
    bridge: clean, but for agents of no group that hear and are heard by all. ring: in a group each
    hears the two beside it in the list, the last beside the first.
    """

    groups: Groups
    kind: PartitionKind = "clean"
    bridge: Annotated[tuple[AgentId, ...], Meta(max_length=1000)] = ()


class FlapTable(Table, frozen=True):
    """Links that go down and up: down for the first half of each period; ``links``: all if none."""

    period_s: FlapPeriod
    links: Annotated[tuple[Pair, ...], Meta(max_length=10_000)] = ()

    def from_s(self, time_s: float) -> Flap:
        """Return the flap as it begins at a time [s]."""
        return Flap(self.period_s, time_s, self.links)


def partition_of(told: Groups | PartitionTable) -> PartitionTable:
    """Return a partition as a table; groups alone are a clean one."""
    return told if isinstance(told, PartitionTable) else PartitionTable(told)


def partition_faults(told: Groups | PartitionTable, agents: int) -> Iterator[tuple[str, str]]:
    """Return what is wrong with a partition of a fleet of so many: key and words."""
    prefix = "partition.groups" if isinstance(told, PartitionTable) else "partition"
    partition = partition_of(told)
    named = [(f"{prefix}[{index}]", group) for index, group in enumerate(partition.groups)]
    seen: set[int] = set()
    for key, group in [*named, ("partition.bridge", partition.bridge)]:
        for agent in group:
            if agent >= agents:
                yield key, f"no agent {agent}; 0 to {agents - 1}"
            if agent in seen:
                yield key, f"agent {agent} is named twice"
            seen.add(agent)
    if bool(partition.bridge) != (partition.kind == "bridge"):
        yield "partition.bridge", "the agents that all hear; with kind = 'bridge', and only there"


def flap_faults(flap: FlapTable, agents: int) -> Iterator[tuple[str, str]]:
    """Return what is wrong with a flap in a fleet of so many: key and words."""
    for index, pair in enumerate(flap.links):
        for agent in pair:
            if agent >= agents:
                yield f"flap.links[{index}]", f"no agent {agent}; 0 to {agents - 1}"
        if pair[0] == pair[1]:
            yield f"flap.links[{index}]", "a link to itself; [from, to], two agents"
        if pair in flap.links[:index]:
            yield f"flap.links[{index}]", "given before"
