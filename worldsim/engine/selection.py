"""Which agents a selector means, at the moment when its event happens."""

from typing import NamedTuple

import numpy as np

from agent.messages import Place
from agent.qstructure.formation import Formation
from worldsim.scenario.faults import Selectors

RANDOM_KEY = 0xFA17


class Claims(NamedTuple):
    """The place that each agent last claimed, in a formation."""

    places: list[tuple[int, int] | None]
    """Queue and rank; row i = agent i."""
    formation: Formation

    def holders(self, selector: str, among: list[int]) -> list[int]:
        """Return the agents that hold the vertex, or a place of the queue, of that name."""
        word, _, name = selector.partition(":")
        held = [(agent, Place(*place)) for agent in among if (place := self.places[agent])]
        if word == "vertex":
            return [agent for agent, place in held if place == self.formation.vertex_places[name]]
        index = [queue.name for queue in self.formation.queues].index(name)
        return [agent for agent, place in held if index in self.formation.queues_of(place)]


class Candidates(NamedTuple):
    """The agents that an event may select from."""

    agents: list[int]
    """In ascending order."""
    running: list[int]
    """Those of them that step, and so hold the place they claim."""


def selected(
    selectors: Selectors, candidates: Candidates, claims: Claims, key: tuple[int, int]
) -> tuple[int, ...]:
    """Return the candidates that any selector means, in ascending order.

    key: the run's seed and the event's number, by which random ones are drawn.
    """
    chosen: set[int] = set()
    for selector in selectors:
        if isinstance(selector, int):
            chosen.add(selector)
        elif selector == "all":
            chosen.update(candidates.agents)
        elif selector.startswith("random:"):
            count = int(selector.removeprefix("random:"))
            chosen.update(_drawn(count, candidates.agents, key))
        else:
            chosen.update(claims.holders(selector, candidates.running))
    return tuple(agent for agent in candidates.agents if agent in chosen)


def _drawn(count: int, agents: list[int], key: tuple[int, int]) -> list[int]:
    seed, number = key
    generator = np.random.Generator(np.random.Philox(key=[seed, number << 20 | RANDOM_KEY]))
    drawn: list[int] = generator.permutation(agents)[:count].tolist()
    return drawn
