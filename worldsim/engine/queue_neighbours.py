"""Which of the agents that an agent hears it needs: N_c,i of Sec. 3.4, |R_c,i| of Algorithm 1.

They are the agents of its own queue, its vertex agents and its parent included. A vertex that
queues share belongs to each of them.
"""

from collections.abc import Sequence
from typing import final

from agent.messages import NO_MISSION, Telemetry
from worldsim.judge.phase import Phase

NO_QUEUES: frozenset[tuple[int, int]] = frozenset()


class QueueNeighbours:
    """The queues of each agent by its newest claim. phases: of the run so far, in order."""

    def __init__(self, rows: int, phases: Sequence[Phase]) -> None:
        self._phases = phases
        self._places: list[tuple[int, int] | None] = [None] * rows
        """Queue and rank, as claimed in ``_missions``."""
        self._missions = [NO_MISSION] * rows
        self._queues = [NO_QUEUES] * rows
        """Each queue with the key of the mission that it belongs to."""
        self._changes = 0
        """How often any agent has claimed another place."""
        self._counted: list[_Counted | None] = [None] * rows

    def count(self, agent: int, telemetry: Telemetry) -> int | None:
        """Take an agent's telemetry; return how many of those that it hears are of its queues.

        None while it claims no place. Agents that fly another mission are not of its queues.
        """
        place, mission = telemetry.place, telemetry.mission
        if place != self._places[agent] or mission != self._missions[agent]:
            self._places[agent], self._missions[agent] = place, mission
            self._queues[agent] = self._queues_of(place, mission)
            self._changes += 1
        if place is None:
            return None
        parent, heard, counted = telemetry.parent, telemetry.heard, self._counted[agent]
        if counted is None or not counted.holds(self._changes, parent, heard):
            counted = _Counted(self._changes, parent, heard, self._needed(agent, parent, heard))
            self._counted[agent] = counted
        return counted.needed

    def _needed(self, agent: int, parent: int, heard: tuple[int, ...]) -> int:
        own, queues, needed = self._queues[agent], self._queues, 0
        for other in heard:
            if other < len(queues) and (other == parent or not own.isdisjoint(queues[other])):
                needed += 1
        return needed

    def _queues_of(self, place: tuple[int, int] | None, mission: int) -> frozenset[tuple[int, int]]:
        if place is None:
            return NO_QUEUES
        flown = [phase.formation for phase in self._phases if phase.mission <= mission]
        queues = flown[-1].queues_of((place[0], place[1]))
        return frozenset((mission, queue) for queue in queues)


@final
class _Counted:
    """What an agent was counted to need, and what that follows from."""

    def __init__(self, changes: int, parent: int, heard: tuple[int, ...], needed: int) -> None:
        self._changes = changes
        self._parent = parent
        self._heard = heard
        self.needed = needed

    def holds(self, changes: int, parent: int, heard: tuple[int, ...]) -> bool:
        """Whether the count follows from these too."""
        return self._changes == changes and self._parent == parent and self._heard == heard
