"""Selectors: the agents that they select at the time of their event."""

from typing import NamedTuple, assert_never

import numpy as np

from agent.messages import Place
from agent.qstructure.formation import Formation
from worldsim.scenario.selectors import (
    AllAgents,
    OneAgent,
    OtherProcess,
    QueueAgents,
    RandomAgents,
    Selector,
    Selectors,
    VertexAgent,
    parsed,
)

RANDOM_KEY = 0xFA17


class Claims(NamedTuple):
    """The places that agents claim in a formation, as last reported."""

    places: list[tuple[int, int] | None]
    """Queue and rank; row i = agent i."""
    formation: Formation

    def of_vertex(self, name: str, agents: list[int]) -> list[int]:
        """Return those of the agents that claim a vertex."""
        vertex = self.formation.vertex_places[name]
        return [agent for agent, place in self._claimed(agents) if place == vertex]

    def of_queue(self, name: str, agents: list[int]) -> list[int]:
        """Return those of the agents that claim a place of a queue."""
        index = [queue.name for queue in self.formation.queues].index(name)
        queues_of = self.formation.queues_of
        return [agent for agent, place in self._claimed(agents) if index in queues_of(place)]

    def _claimed(self, agents: list[int]) -> list[tuple[int, Place]]:
        return [(agent, Place(*place)) for agent in agents if (place := self.places[agent])]


class Candidates(NamedTuple):
    """The agents that an event may select from."""

    agents: list[int]
    """In ascending order."""
    running: list[int]
    """Those of them that are running, and so hold the place that they claim."""


def selected(
    selectors: Selectors, candidates: Candidates, claims: Claims, key: tuple[int, int]
) -> tuple[int, ...]:
    """Return the candidates that the selectors select, in ascending order.

    key: the run's seed and the event's number, for random draws.
    """
    chosen: set[int] = set()
    for selector in selectors:
        chosen.update(_selected(selector, candidates, claims, key))
    return tuple(agent for agent in candidates.agents if agent in chosen)


def _selected(
    selector: Selector, candidates: Candidates, claims: Claims, key: tuple[int, int]
) -> list[int]:
    kind = parsed(selector)
    match kind:
        case OneAgent(agent):
            return [agent]
        case AllAgents():
            return candidates.agents
        case RandomAgents(number):
            return _drawn(number, candidates.agents, key)
        case VertexAgent(name):
            return claims.of_vertex(name, candidates.running)
        case QueueAgents(name):
            return claims.of_queue(name, candidates.running)
        case OtherProcess():
            return []  # event_checks allows it in the events of processes of no agent only
    assert_never(kind)


def _drawn(count: int, agents: list[int], key: tuple[int, int]) -> list[int]:
    seed, number = key
    generator = np.random.Generator(np.random.Philox(key=[seed, number << 20 | RANDOM_KEY]))
    drawn: list[int] = generator.permutation(agents)[:count].tolist()
    return drawn
