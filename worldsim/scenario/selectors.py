"""Selectors of agents: one type for each form that an event's list may hold."""

import re
from typing import Annotated, Literal, NamedTuple

from msgspec import Meta

AGENTS = "an id, 'vertex:V1', 'queue:Q1', 'random:2' or 'all'"
"""Selectors of agents, in words."""
STOPPABLE = f"{AGENTS}; or 'netem' or 'world', alone"
"""Selectors of processes to kill or pause, in words."""
RETURNING = "an id, 'random:2' or 'all'"
"""Selectors of agents that come back, and hold no places to be selected by, in words."""
Selector = Annotated[int | str, Meta(description=AGENTS)]
"""As a scenario writes it."""
_Many = Meta(min_length=1, max_length=1000)
Selectors = Annotated[tuple[Selector, ...], _Many]
StoppableSelectors = Annotated[tuple[Annotated[int | str, Meta(description=STOPPABLE)], ...], _Many]
ReturningSelectors = Annotated[tuple[Annotated[int | str, Meta(description=RETURNING)], ...], _Many]

ProcessName = Literal["netem", "world"]
"""The processes that the whole fleet needs; netem: those of all shards."""

_TEXT = re.compile(
    r"(?P<all>all)|(?P<process>netem|world)|random:(?P<random>[1-9]\d{0,3})|vertex:(?P<vertex>.+)|queue:(?P<queue>.+)",
    re.DOTALL,
)


class OneAgent(NamedTuple):
    """The agent of an id."""

    id: int


class AllAgents(NamedTuple):
    """Every agent."""


class RandomAgents(NamedTuple):
    """Some agents, drawn from the seed."""

    number: int


class VertexAgent(NamedTuple):
    """The agent that holds a vertex."""

    name: str


class QueueAgents(NamedTuple):
    """The agents that hold a place of a queue."""

    name: str


class OtherProcess(NamedTuple):
    """A process that the whole fleet needs, of no agent."""

    name: ProcessName


ParsedSelector = OneAgent | AllAgents | RandomAgents | VertexAgent | QueueAgents | OtherProcess


class SelectorError(ValueError):
    """A text that is no selector."""


def parsed(selector: Selector) -> ParsedSelector:
    """Return a selector's type. Raises SelectorError."""
    if isinstance(selector, int):
        return OneAgent(selector)
    match = _TEXT.fullmatch(selector)
    if match is None:
        raise SelectorError(f"no selector: {selector!r}")
    if match["process"]:
        return OtherProcess("netem" if match["process"] == "netem" else "world")
    if match["random"]:
        return RandomAgents(int(match["random"]))
    if match["vertex"]:
        return VertexAgent(match["vertex"])
    if match["queue"]:
        return QueueAgents(match["queue"])
    return AllAgents()


def other_process(selectors: Selectors) -> ProcessName | None:
    """Return the process that the selectors name instead of agents; None where they do not."""
    match selectors:
        case ("netem",):
            return "netem"
        case ("world",):
            return "world"
    return None
