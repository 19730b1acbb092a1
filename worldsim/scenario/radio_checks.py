"""What must hold of a radio fault by itself, in a fleet of so many agents."""

from collections.abc import Iterator

from netem.faults import Flap, Partition, RadioEvent
from netem.link_keys import Conditions
from worldsim.scenario.problem import Problem


def radio_findings(event: RadioEvent, agents: int) -> Iterator[Problem]:
    """Return what is wrong with the radio fault of an event, if it has one."""
    fault = event.radio_fault
    match fault:
        case Partition():
            prefix = "partition" if event.partition is not fault else "partition.groups"
            yield from _partition(fault, prefix, agents)
        case Flap():
            yield from _flap(fault, agents)
        case Conditions():
            yield from _links(fault, agents)


def _partition(partition: Partition, prefix: str, agents: int) -> Iterator[Problem]:
    named = [(f"{prefix}[{index}]", group) for index, group in enumerate(partition.groups)]
    seen: set[int] = set()
    for key, group in [*named, ("partition.bridge", partition.bridge)]:
        for agent in group:
            if agent >= agents:
                yield Problem(key, _unknown(agent, agents))
            if agent in seen:
                yield Problem(key, f"agent {agent} is named twice")
            seen.add(agent)
    if bool(partition.bridge) != (partition.kind == "bridge"):
        detail = "the agents that all hear; with kind = 'bridge', and only there"
        yield Problem("partition.bridge", detail)


def _flap(flap: Flap, agents: int) -> Iterator[Problem]:
    for index, pair in enumerate(flap.links):
        key = f"flap.links[{index}]"
        for agent in pair:
            if agent >= agents:
                yield Problem(key, _unknown(agent, agents))
        if pair[0] == pair[1]:
            yield Problem(key, "a link to itself; [from, to], two agents")
        if pair in flap.links[:index]:
            yield Problem(key, "given before")


def _links(conditions: Conditions, agents: int) -> Iterator[Problem]:
    for index, link in enumerate(conditions.link):
        for name, agent in (("from", link.source), ("to", link.to)):
            if agent >= agents:
                yield Problem(f"netem.link[{index}].{name}", _unknown(agent, agents))
        if link.source == link.to:
            yield Problem(f"netem.link[{index}].to", "a link to itself")


def _unknown(agent: int, agents: int) -> str:
    return f"no agent {agent}; 0 to {agents - 1}"
