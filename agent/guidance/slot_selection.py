"""When an agent chooses its place anew.

Algorithm 1 runs at 5 Hz; but what an agent knows of its team changes piecemeal when many come or
go at once, as when a partition begins or ends. A choice made half way moves vehicles for nothing,
so a place is kept until the news has settled.
"""

from collections.abc import Sequence
from math import dist

from agent.config import AgentSetup
from agent.controller import Heard, Peer, Senses
from agent.guidance.occupied_slots import Blocked
from agent.guidance.target_on_queue import OwnTarget, TargetOnQueue
from agent.messages import Place

CHOICE_HZ = 5.0
CALM_S = 4.0
LONGEST_S = 3.0
"""Who keeps its place for ``CALM_S`` starts anew; nobody is held to one for longer than this."""
LISTEN_S = 0.4
"""What is known of the team is acted on once it has not changed for so long."""
ALONE_S = 1.5
"""One who has heard nobody yet waits so long before it takes itself for the whole team: beacons
may be under way for longer than ``LISTEN_S``."""
PATIENCE_S = 1.0
"""Who has a place waits so long at most: in a bad radio somebody comes or goes all the time."""


class Choice:
    """One agent's place, and why it has it.

    cost_m: how far it was from its place when it first claimed it.
    """

    def __init__(self, setup: AgentSetup) -> None:
        self.cost_m = 0.0
        self._targets = TargetOnQueue(setup.id, setup.control.spacing_m)
        self._blocked = Blocked(self._targets, "proximity" in setup.vehicle.sensors)
        self._mine: OwnTarget | None = None
        self._known: tuple[tuple[int, ...], frozenset[Place]] = ((), frozenset())
        self._listening, self._new_at_s, self._changed_s = True, 0.0, 0.0
        self._chosen_for = -1
        self._again_s = -1.0
        self._changes, self._moved_s = 0, 0.0

    @property
    def blocked(self) -> tuple[Place, ...]:
        """The places that it sees taken by a silent body (E18)."""
        return self._blocked.seen

    def made(self, senses: Senses) -> OwnTarget | None:
        """Return the own place; chosen anew at 5 Hz (Algorithm 1), and at once in a new mission."""
        new = senses.mission.key != self._chosen_for
        if senses.now_s >= self._again_s or new:
            team = senses.team()
            blocked = self._blocked.now(senses, team)
            if not self._listens(senses.now_s, team, blocked):
                self._choose(senses, team, blocked, new)
        return self._mine

    def _choose(
        self, senses: Senses, team: Sequence[Peer], blocked: frozenset[Place], new: bool
    ) -> None:
        mission, now_s = senses.mission, senses.now_s
        self._again_s = now_s + 1.0 / CHOICE_HZ - 1e-9
        self._chosen_for = mission.key
        before = self._mine.place if self._mine is not None else None
        self._mine = self._targets.choose(mission, team, blocked)
        if self._mine is not None and (before != self._mine.place or new):
            self._again_s = now_s + self._held_s(now_s, _age_s(senses.neighbours))
            self.cost_m = dist(senses.position, mission.frame.to_world(self._mine.slot.point))

    def _held_s(self, now_s: float, age_s: float) -> float:
        """Return for how long a place just taken is kept whatever one hears [s].

        No answer to a claim comes sooner than word takes there and back; and whoever changes its
        place time after time, since what it knows comes late, does so ever more rarely.
        """
        in_a_row = self._changes if now_s - self._moved_s < CALM_S else 0
        self._changes, self._moved_s = in_a_row + 1, now_s
        return max(1.0 / CHOICE_HZ, 2.0 * age_s, min(LONGEST_S, 2.0**in_a_row / CHOICE_HZ)) - 1e-9

    def _listens(self, now_s: float, team: Sequence[Peer], blocked: frozenset[Place]) -> bool:
        """Whether what an agent knows of its team has only just changed.

        Until nobody new turns up it claims nothing (E24): a claim made knowing nobody is a vertex.
        """
        known = (tuple([peer.id for peer in team]), blocked)
        if known != self._known:
            if not self._listening:
                self._listening, self._changed_s = True, now_s
            self._known, self._new_at_s = known, now_s
        alone = self._mine is None and len(team) == 1
        quiet = now_s - self._new_at_s >= (ALONE_S if alone else LISTEN_S) - 1e-6
        patient = self._mine is None or now_s - self._changed_s < PATIENCE_S
        self._listening = not quiet and patient
        return self._listening


def _age_s(neighbours: Sequence[Heard]) -> float:
    """Return how old what one hears is on average [s]: no answer to a claim comes sooner."""
    return sum(other.age_s for other in neighbours) / max(1, len(neighbours))
