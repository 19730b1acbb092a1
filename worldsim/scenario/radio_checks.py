"""Checks of a single radio fault, in a fleet of a given size."""

from collections.abc import Iterator
from typing import Any, assert_never

from netem.faults import Flap, Heal, Jam, Partition, RadioKeys, Sabotage
from netem.link_parameters import Conditions
from worldsim.scenario.problem import Problem


def radio_problems(event: RadioKeys[Any], agents: int) -> Iterator[Problem]:
    """Yield what makes the radio fault of an event invalid; nothing for other events."""
    fault = event.radio_fault
    match fault:
        case Partition():
            prefix = "partition" if event.partition is not fault else "partition.groups"
            yield from _partition(fault, prefix, agents)
        case Flap():
            yield from _flap(fault, agents)
        case Conditions():
            yield from _links(fault, agents)
        case Jam() | Heal() | Sabotage() | None:
            pass
        case _:
            assert_never(fault)


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
        detail = "agents that keep all links; goes with kind = 'bridge', and only with it"
        yield Problem("partition.bridge", detail)


def _flap(flap: Flap, agents: int) -> Iterator[Problem]:
    for index, pair in enumerate(flap.links):
        key = f"flap.links[{index}]"
        for agent in pair:
            if agent >= agents:
                yield Problem(key, _unknown(agent, agents))
        if pair[0] == pair[1]:
            yield Problem(key, "a link to itself; [from, to] are two agents")
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
