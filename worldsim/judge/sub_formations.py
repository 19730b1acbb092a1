"""Sub-formations: from when on each queue's members stand in their line, wherever the line is.

The paper expects queues to form before the whole formation does (Sec. 3.1, advantage i). The
members of a queue are those that hold its places, without the agents in vertices. They stand in
their line while the distances among them are those among their slots.
"""

from collections.abc import Sequence
from itertools import pairwise
from typing import Final, NamedTuple, TypedDict

import numpy as np
from numpy.typing import NDArray

from agent.messages import Vector
from worldsim.judge.phase import Phase, SlotsByRow
from worldsim.judge.tick import Tick
from worldsim.truth.vehicle import Floats

SHAPE_M: Final = 0.3
"""Largest error of a distance between two members that stand in their line [m]."""


class SubFormationsRow(TypedDict):
    """The sub-formations of one formation, as summary.json holds them."""

    formation: str
    from_s: float
    stands_s: dict[str, float | None]  # by queue name, from ``from_s``
    lead_s: float | None


class _Placed(NamedTuple):
    """A member."""

    row: int
    queue: int
    slot: Vector  # [m; target's frame]


class _Pairs(NamedTuple):
    """Some pairs of members, each of one queue."""

    one: NDArray[np.intp]  # (P,) rows
    other: NDArray[np.intp]  # (P,)
    apart: Floats  # (P,) distance of their slots [m]
    queue: NDArray[np.intp]  # (P,)


class SubFormations:
    """Watches the queues of one phase."""

    def __init__(self, phase: Phase) -> None:
        self.names = tuple(queue.name for queue in phase.formation.queues)
        self._phase = phase
        self._since_s: list[float | None] = [None for _ in self.names]
        self._slots: SlotsByRow | None = None
        """The slots that the pairs were found for; another object once any changed."""
        self._lines = 0
        """Number of queues with at least two members."""
        self._placed: dict[int, list[_Placed]] = {}
        """The members of each of them of which all have valid slots."""
        self._neighbours = _pairs_of([])
        """The neighbours along all these queues."""
        self._others: dict[tuple[int, ...], _Pairs] = {}
        """All other pairs of some queues; they are found only once their neighbours stand."""

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
            self._find_pairs(tick, slots)
        broken = _broken(self._neighbours, tick.position)
        standing = tuple([queue for queue in self._placed if queue not in broken])
        broken |= _broken(self._others_of(standing), tick.position)
        for queue in self._placed:
            if queue in broken:
                self._since_s[queue] = None
            elif self._since_s[queue] is None:
                self._since_s[queue] = tick.time_s

    def _find_pairs(self, tick: Tick, slots: SlotsByRow) -> None:
        found = self._members(tick)
        self._lines = sum(len(rows) > 1 for rows in found)
        self._placed, self._others = {}, {}
        for queue, rows in enumerate(found):
            if len(rows) > 1 and all(row in slots for row in rows):
                self._placed[queue] = [_Placed(row, queue, slots[row].point) for row in rows]
            else:
                self._since_s[queue] = None
        near = [pair for members in self._placed.values() for pair in pairwise(members)]
        self._neighbours = _pairs_of(near)

    def _others_of(self, queues: tuple[int, ...]) -> _Pairs:
        if queues not in self._others:
            lines = [self._placed[queue] for queue in queues]
            self._others = {
                queues: _pairs_of(
                    [(a, b) for line in lines for k, a in enumerate(line) for b in line[k + 2 :]]
                )
            }
        return self._others[queues]

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


def _pairs_of(pairs: Sequence[tuple[_Placed, _Placed]]) -> _Pairs:
    rows = np.array([(a.row, b.row) for a, b in pairs], dtype=np.intp).reshape(-1, 2)
    points = np.array([(a.slot, b.slot) for a, b in pairs]).reshape(-1, 2, 3)
    queue = np.array([a.queue for a, _ in pairs], dtype=np.intp)
    return _Pairs(rows[:, 0], rows[:, 1], _lengths(points[:, 0] - points[:, 1]), queue)


def _broken(pairs: _Pairs, position: Floats) -> set[int]:
    """Return the queues of those pairs whose distance is not that of their slots."""
    if not len(pairs.one):
        return set()
    apart = _lengths(position[pairs.one] - position[pairs.other])
    kept = np.abs(apart - pairs.apart) <= SHAPE_M
    return set() if kept.all() else {*pairs.queue[~kept].tolist()}


def _lengths(away: Floats) -> Floats:
    square = away * away
    found: Floats = np.sqrt(square[:, 0] + square[:, 1] + square[:, 2])
    return found
