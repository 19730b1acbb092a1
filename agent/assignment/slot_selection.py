"""Slot selection: when an agent chooses its place anew.

Algorithm 1 runs at 5 Hz. But the knowledge of the team changes piecemeal when many agents come or
go at once, as when a partition begins or ends. A choice made half way moves vehicles for nothing,
so a place is kept until the knowledge has settled.
"""

from collections.abc import Sequence
from math import dist
from typing import Final

from agent.assignment.target_on_queue import TargetOnQueue
from agent.config import AgentSetup
from agent.controller import Flown, Heard, Peer, Senses, Words
from agent.messages import DISTRESS, MEMBER, VERTEX, Place
from agent.places.occupied_slots import OccupiedSlots
from agent.places.place_points import OwnTarget, PlacePoints
from agent.qstructure.formation import NO_PLACES

CHOICE_HZ: Final = 5.0
CALM_S: Final = 4.0
"""An agent that keeps its place for this long starts counting its changes anew."""
LONGEST_S: Final = 3.0
"""Longest time for which repeated changes hold an agent to a place."""
SETTLED_S: Final = 0.4
"""Knowledge of the team settles when it has not changed for this long."""
ALONE_S: Final = 1.5
"""The same for an agent that has heard no other yet: beacons may be delayed by more than
``SETTLED_S``."""
PATIENCE_S: Final = 1.0
"""Longest wait of an agent with a place: over a bad radio the knowledge never settles."""


class SlotSelection:
    """One agent's choice of its place.

    cost_m: its distance to the place when it first claimed it [m].
    """

    def __init__(self, setup: AgentSetup) -> None:
        self.cost_m = 0.0
        points = PlacePoints(setup.control.spacing_m)
        self._targets = TargetOnQueue(setup.id, points)
        self._occupied = OccupiedSlots(points, "proximity" in setup.vehicle.sensors)
        self._own: OwnTarget | None = None
        self._known: tuple[tuple[int, ...], frozenset[Place]] = ((), NO_PLACES)
        self._listening, self._new_at_s, self._changed_s = True, 0.0, 0.0
        self._mission_key = -1
        self._next_choice_s = -1.0
        self._changes, self._moved_s = 0, 0.0

    @property
    def blocked(self) -> tuple[Place, ...]:
        """The places that the agent sees taken by an unidentified vehicle (E18)."""
        return self._occupied.seen

    def words(self, _now_s: float) -> Words:
        """Return the own role; the assignment knows no tiers."""
        own = self._own
        role = DISTRESS if own is None else VERTEX if own.vertex else MEMBER
        return Words(role=role)

    def select(self, senses: Senses) -> OwnTarget | None:
        """Return the own target; chosen anew at 5 Hz (Algorithm 1), at once in a new mission.

        None where all queues are full, and without a mission.
        """
        mission = senses.mission
        if mission is None:
            return None
        new = mission.key != self._mission_key
        if senses.now_s >= self._next_choice_s or new:
            team = senses.team()
            holders = [(peer.place, peer.position) for peer in team]
            blocked = self._occupied.update(senses, mission, holders, len(team), senses.blocked)
            if not self._is_listening(senses.now_s, team, blocked):
                self._choose(senses, mission, team, blocked)
        return self._own

    def _choose(
        self, senses: Senses, mission: Flown, team: Sequence[Peer], blocked: frozenset[Place]
    ) -> None:
        new, now_s = mission.key != self._mission_key, senses.now_s
        self._next_choice_s = now_s + 1.0 / CHOICE_HZ - 1e-9
        self._mission_key = mission.key
        before = self._own.place if self._own is not None else None
        self._own = self._targets.choose(mission, team, blocked)
        if self._own is not None and (before != self._own.place or new):
            self._next_choice_s = now_s + self._hold_s(now_s, _mean_age_s(senses.neighbours))
            self.cost_m = dist(senses.position, mission.frame.to_world(self._own.slot.point))

    def _hold_s(self, now_s: float, age_s: float) -> float:
        """Return how long a new place is kept whatever the agent hears [s]. age_s: of beacons [s].

        An answer to a claim takes a message there and one back. An agent that changes its place
        again and again, since its knowledge is late, does so ever more rarely.
        """
        in_a_row = self._changes if now_s - self._moved_s < CALM_S else 0
        self._changes, self._moved_s = in_a_row + 1, now_s
        return max(1.0 / CHOICE_HZ, 2.0 * age_s, min(LONGEST_S, 2.0**in_a_row / CHOICE_HZ)) - 1e-9

    def _is_listening(self, now_s: float, team: Sequence[Peer], blocked: frozenset[Place]) -> bool:
        """Whether the agent waits because its knowledge of the team has only just changed.

        A new agent claims nothing until no further member turns up (E24): with no member known, it
        would claim a vertex.
        """
        known = (tuple([peer.id for peer in team]), blocked)
        if known != self._known:
            if not self._listening:
                self._listening, self._changed_s = True, now_s
            self._known, self._new_at_s = known, now_s
        alone = self._own is None and len(team) == 1
        quiet = now_s - self._new_at_s >= (ALONE_S if alone else SETTLED_S) - 1e-6
        patient = self._own is None or now_s - self._changed_s < PATIENCE_S
        self._listening = not quiet and patient
        return self._listening


def _mean_age_s(neighbours: Sequence[Heard]) -> float:
    """Return the mean age of the neighbours' beacons [s]."""
    return sum(other.age_s for other in neighbours) / max(1, len(neighbours))
