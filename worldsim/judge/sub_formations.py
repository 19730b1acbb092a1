"""Sub-formations: from when on each queue's members stand in their line, wherever the line is.

The paper expects queues to form before the whole formation does (Sec. 3.1, advantage i). The
members of a queue are those that hold its places, without the agents in vertices. They stand in
their line while the distances among them are those among their slots.
"""

from collections.abc import Sequence
from math import sqrt
from typing import Final, TypedDict, final

import numpy as np

from agent.messages import Vector
from worldsim.judge.metrics import ROUNDING_M
from worldsim.judge.phase import Phase, SlotsByRow
from worldsim.judge.tick import Tick

SHAPE_M: Final = 0.3
"""Largest error of a distance between two members that stand in their line [m]."""


class SubFormationsRow(TypedDict):
    """The sub-formations of one formation, as summary.json holds them."""

    formation: str
    from_s: float
    stands_s: dict[str, float | None]  # by queue name, from ``from_s``
    lead_s: float | None


@final
class _Line:
    """The members of a queue, and whether all stand as far from each other as their slots do.

    rows: of its members in order; slots: of each [m; target's frame].
    """

    def __init__(self, rows: list[int], slots: list[Vector]) -> None:
        self._rows = rows
        self._slots = slots
        self._broken: tuple[int, int] | None = None
        """Two members that stood too near or too far at the last tick; None where all stood."""
        self._stood: list[Vector] = []
        """Where the members were when all pairs were last looked at, and stood [m]."""
        self._slack_m = 0.0
        """By how much the error of each pair was less than allowed then."""

    def stands(self, position: Sequence[Sequence[float]]) -> bool:
        """Return whether the line stands. position: of all agents [m; world frame].

        All pairs are looked at only where neither one that was broken still is, nor all members
        have moved together but for less than half of the slack.
        """
        here: list[Vector] = [(x, y, z) for x, y, z in [position[row] for row in self._rows]]
        if self._broken is not None and self._slack_of(here, *self._broken) < 0.0:
            return False
        return self._moved_as_one(here) or self._look_at_all(here)

    def _moved_as_one(self, here: list[Vector]) -> bool:
        if not self._stood:
            return False
        x, y, z = here[0]
        from_x, from_y, from_z = self._stood[0]
        x, y, z = x - from_x, y - from_y, z - from_z
        most = 0.25 * self._slack_m * self._slack_m
        for k, (a, b, c) in enumerate(here):
            from_a, from_b, from_c = self._stood[k]
            u, v, w = a - from_a - x, b - from_b - y, c - from_c - z
            if not u * u + v * v + w * w <= most:
                return False
        return True

    def _look_at_all(self, here: list[Vector]) -> bool:
        least_m = SHAPE_M
        for ranks in range(1, len(here)):
            for one in range(len(here) - ranks):
                slack_m = self._slack_of(here, one, one + ranks)
                if slack_m < 0.0:
                    self._broken, self._stood = (one, one + ranks), []
                    return False
                least_m = min(least_m, slack_m)
        self._broken, self._stood = None, here
        self._slack_m = max(0.0, least_m - ROUNDING_M)
        return True

    def _slack_of(self, here: list[Vector], one: int, other: int) -> float:
        """Return by how much the error of a pair's distance is less than allowed [m]."""
        apart_m = _distance(here[one], here[other])
        error_m = abs(apart_m - _distance(self._slots[one], self._slots[other]))
        return SHAPE_M - error_m if error_m <= SHAPE_M else -1.0


class SubFormations:
    """Watches the queues of one phase."""

    def __init__(self, phase: Phase) -> None:
        self.names = tuple(queue.name for queue in phase.formation.queues)
        self._phase = phase
        self._since_s: list[float | None] = [None for _ in self.names]
        self._slots: SlotsByRow | None = None
        """The slots that the lines were found for; another object once any changed."""
        self._lines = 0
        """Number of queues with at least two members."""
        self._placed: dict[int, _Line] = {}
        """The queues that have two members or more, each with a slot."""

    @property
    def stands_s(self) -> list[float | None]:
        """For each queue, the time from the phase's start from which on it stood to the end [s].

        None where it does not stand at the end, or has fewer than two members.
        """
        return [None if s is None else s - self._phase.from_s for s in self._since_s]

    @property
    def lead_s(self) -> float | None:
        """How long all stood in their lines before the whole formation converged [s].

        None where it did not converge, where a queue does not stand, or none has two members.
        """
        converged_s, known = self._phase.converge_s, [s for s in self.stands_s if s is not None]
        if converged_s is None or not known or len(known) < self._lines:
            return None
        return max(0.0, converged_s - max(known))

    @property
    def row(self) -> SubFormationsRow:
        """What summary.json says of them."""
        return {
            "formation": self._phase.formation.name,
            "from_s": self._phase.from_s,
            "stands_s": dict(zip(self.names, self.stands_s, strict=True)),
            "lead_s": self.lead_s,
        }

    def see(self, tick: Tick) -> None:
        """Take a tick; ticks come in order."""
        slots = self._phase.own_slots(tick)
        if slots is not self._slots:
            self._slots = slots
            self._find_lines(tick, slots)
        position = tick.position.tolist()
        for queue, line in self._placed.items():
            if not line.stands(position):
                self._since_s[queue] = None
            elif self._since_s[queue] is None:
                self._since_s[queue] = tick.time_s

    def _find_lines(self, tick: Tick, slots: SlotsByRow) -> None:
        found = self._members(tick)
        self._lines = sum([len(rows) > 1 for rows in found])
        self._placed = {}
        for queue, rows in enumerate(found):
            if len(rows) > 1 and all(row in slots for row in rows):
                self._placed[queue] = _Line(rows, [slots[row].point for row in rows])
            else:
                self._since_s[queue] = None

    def _members(self, tick: Tick) -> list[list[int]]:
        """Return the rows of each queue's members, in the order of their ranks."""
        vertices = frozenset(self._phase.formation.vertex_places.values())
        claims = self._phase.claims(tick)
        members: list[list[int]] = [[] for _ in self.names]
        for row in np.flatnonzero(tick.alive).tolist():
            queue = claims[row][0]
            if 0 <= queue < len(members) and claims[row] not in vertices:
                members[queue].append(row)
        for rows in members:
            rows.sort(key=lambda row: claims[row])
        return members


def _distance(one: Vector, other: Vector) -> float:
    (x, y, z), (a, b, c) = one, other
    u, v, w = x - a, y - b, z - c
    return sqrt(u * u + v * v + w * w)
