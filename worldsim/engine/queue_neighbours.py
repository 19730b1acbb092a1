"""Which of the agents that an agent hears it needs: N_c,i of Sec. 3.4, |R_c,i| of Algorithm 1.

They are the agents of its own queue, its vertex agents and its parent included. A vertex that
queues share belongs to each of them.
"""

from collections.abc import Sequence

from agent.messages import Telemetry
from worldsim.judge.phase import Phase

NO_QUEUES: frozenset[tuple[int, int]] = frozenset()


class QueueNeighbours:
    """The queues of each agent by its newest claim. phases: of the run so far, in order."""

    def __init__(self, rows: int, phases: Sequence[Phase]) -> None:
        self._phases = phases
        self._claims: list[tuple[int, int, int] | None] = [None] * rows
        """Mission, queue and rank."""
        self._queues = [NO_QUEUES] * rows
        """Each queue with the key of the mission that it belongs to."""

    def count(self, agent: int, telemetry: Telemetry) -> int | None:
        """Take an agent's telemetry; return how many of those that it hears are of its queues.

        None while it claims no place. Agents that fly another mission are not of its queues.
        """
        place = telemetry.place
        claim = (telemetry.mission, *place) if place is not None else None
        if claim != self._claims[agent]:
            self._claims[agent], self._queues[agent] = claim, self._queues_of(claim)
        if claim is None:
            return None
        own, queues = self._queues[agent], self._queues
        parent, needed = telemetry.parent, 0
        for other in telemetry.heard:
            if other < len(queues) and (other == parent or not own.isdisjoint(queues[other])):
                needed += 1
        return needed

    def _queues_of(self, claim: tuple[int, int, int] | None) -> frozenset[tuple[int, int]]:
        if claim is None:
            return NO_QUEUES
        mission, *place = claim
        flown = [phase.formation for phase in self._phases if phase.mission <= mission]
        queues = flown[-1].queues_of((place[0], place[1]))
        return frozenset((mission, queue) for queue in queues)
