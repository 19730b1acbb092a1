"""A formation as its members count it: queues, the vertices they begin at, and numbered members.

The members of a queue besides those in vertices are numbered from 1, outwards from the queue's
first vertex, its *home*. A number is a place's rank, counted from the first rank that is no vertex.
"""

from collections.abc import Iterable, Sequence
from functools import lru_cache
from itertools import permutations
from math import dist, inf
from typing import Final, NamedTuple

from agent.messages import MAX_TEAM, ZERO, Place, Vector
from agent.qstructure.formation import NO_PLACES, Formation, Slot
from agent.vectors import apart

MAPS_KEPT: Final = 16
SPARSE: Final = 8
"""The nearest slot is looked for among each so many first."""
LEAST_STEP_M: Final = 1e-6
ROUNDED_UP: Final = 1.0 + 1e-9
"""By this factor a distance exceeds any rounding of it."""


class Nearest(NamedTuple):
    """The nearest of a queue's first members."""

    number: int
    away_m: float


class Row:
    """The slots of a queue's members in their order."""

    def __init__(self, slots: Iterable[Slot] = ()) -> None:
        self.slots: list[Slot] = []
        self._points: list[Vector] = []
        self._longest_m = LEAST_STEP_M
        """No slot is farther from the next one [m]."""
        for slot in slots:
            self.append(slot)

    def append(self, slot: Slot) -> None:
        """Add the next member's slot."""
        if self.slots:
            self._longest_m = max(self._longest_m, dist(self.slots[-1].point, slot.point))
        self.slots.append(slot)
        self._points.append(slot.point)

    def nearest(self, first: int, here: Vector, within_m: float = inf) -> Nearest | None:
        """Return the nearest of the first members; None if none is within a distance [m].

        The slots next to a far one are far, too: they are left out. here [m; target's frame].
        """
        points, end = self._points, min(first, len(self._points))
        near_m = within_m
        if within_m == inf:
            for k in range(0, end, SPARSE):
                if apart(points[k], here) <= ROUNDED_UP * near_m:
                    near_m = min(near_m, dist(points[k], here))
        found, k = -1, 0
        while k < end:
            away_m = apart(points[k], here)
            if away_m <= ROUNDED_UP * near_m:
                away_m = dist(points[k], here)
                if away_m < near_m or (found < 0 and away_m == near_m):
                    found, near_m = k, away_m
            k += max(1, int((away_m - near_m) / self._longest_m))
        return Nearest(found + 1, near_m) if found >= 0 else None


class QueueMap:
    """The queues and vertices of a formation by number. ``homed``: the queues of each home."""

    def __init__(self, formation: Formation) -> None:
        self.formation = formation
        names = list(formation.vertices)
        numbers = range(len(formation.queues))
        self.queues, self.vertices = len(formation.queues), len(names)
        self.vertex_places = [formation.vertex_places[name] for name in names]
        self.vertex_points: list[Vector] = [formation.vertices[name] for name in names]
        self.vertex_of = {place: v for v, place in enumerate(self.vertex_places)}
        self.vertices_of = [
            [v for v, place in enumerate(self.vertex_places) if j in formation.queues_of(place)]
            for j in numbers
        ]
        self.home = [names.index(formation.first_vertex_of(j)) for j in numbers]
        self.homed = [[j for j in numbers if self.home[j] == v] for v in range(len(names))]
        self.closed = [queue.closed for queue in formation.queues]
        self._common = frozenset(formation.common)
        self._first_rank = [len(queue.stations) for queue in formation.queues]
        self._vertex_slots = [
            formation.slot_at(place.queue, formation.queues[place.queue].stations[place.rank])
            for place in self.vertex_places
        ]
        self._open_rows = [Row() for _ in numbers]
        self._places: list[list[Place]] = [[] for _ in numbers]
        """The places of each queue by rank, as far as they were asked for."""
        self.members = lru_cache(maxsize=64)(self._members)
        self.led = lru_cache(maxsize=64)(self._led)
        self.blocked_numbers = lru_cache(maxsize=64)(self._blocked_numbers)
        self._closed_row = lru_cache(maxsize=64)(self._measured_row)
        self._nearest_pairs: list[tuple[int, int]] | None = None

    @property
    def nearest_pairs(self) -> list[tuple[int, int]]:
        """All pairs of two queues, by the distance between their first members' places."""
        if self._nearest_pairs is None:
            self._nearest_pairs = self._pairs_by_distance()
        return self._nearest_pairs

    def _pairs_by_distance(self) -> list[tuple[int, int]]:
        firsts = [self.slot(j, 1, 1) for j in range(self.queues)]
        points = [slot.point if slot is not None else ZERO for slot in firsts]
        pairs = permutations(range(self.queues), 2)
        return sorted(pairs, key=lambda pair: (dist(points[pair[0]], points[pair[1]]), pair))

    def is_common(self, vertex: int) -> bool:
        """Whether several queues share a vertex."""
        return self.vertex_places[vertex] in self._common

    def place(self, queue: int, number: int) -> Place:
        """Return the place of a queue's member."""
        rank = self._first_rank[queue] - 1 + number
        if not 0 <= rank < MAX_TEAM or queue < 0:
            return Place(queue, rank)
        places = self._places[queue]
        while len(places) <= rank:
            places.append(Place(queue, len(places)))
        return places[rank]

    def number(self, place: tuple[int, int]) -> int:
        """Return a member's number in its queue, counted from 1; less than 1 for a vertex."""
        queue, rank = place
        return rank - self._first_rank[queue] + 1 if 0 <= queue < self.queues else 0

    def with_vacancies(
        self, shares: Sequence[int], counts: Sequence[int], vacant: Iterable[int]
    ) -> tuple[int, ...]:
        """Return the shares, and one more in a queue of each vertex that nobody will stand for.

        vacant: vertices without a leader. Where a queue through one has members, they stand for it.
        """
        wanted = [*shares]
        for v in vacant:
            if not any(counts[j] for j in self.queues_through(v)):
                wanted[self.queues_through(v)[0]] += 1
        return tuple(wanted)

    def queues_through(self, vertex: int) -> list[int]:
        """Return the queues that have a vertex."""
        return [j for j in range(self.queues) if vertex in self.vertices_of[j]]

    def vertex_slot(self, vertex: int) -> Slot | None:
        """Return a vertex's slot."""
        return self._vertex_slots[vertex]

    def slot(self, queue: int, number: int, members: int) -> Slot | None:
        """Return a member's slot; None where there is none.

        members: of the queue; those of a closed one share its length.
        """
        if number < 1:
            return None
        slots = self._row(queue, number, members).slots
        return slots[number - 1] if number <= len(slots) else None

    def nearest(
        self, queue: int, members: int, here: Vector, within_m: float = inf
    ) -> Nearest | None:
        """Return the nearest of a queue's first members; None if none is within a distance [m].

        here [m; target's frame].
        """
        first = max(members, 1)
        return self._row(queue, first, members).nearest(first, here, within_m)

    def along(self, queue: int, members: int, here: Vector) -> float:
        """Return where a point lies along a queue: 0 beside its home, k beside its k-th member.

        Before the home and beyond the last of so many members the line goes straight on. here [m;
        target's frame].
        """
        row = self._row(queue, max(members, 1), members).slots[: max(members, 1)]
        points = [self.vertex_points[self.home[queue]], *(slot.point for slot in row)]
        k = min(range(len(points)), key=lambda n: dist(points[n], here))
        before, behind = max(k - 1, 0), min(k + 1, len(points) - 1)
        step = [b - a for a, b in zip(points[before], points[behind], strict=True)]
        length2 = sum(each * each for each in step)
        if length2 == 0.0:
            return float(k)
        ahead = sum((h - p) * s for h, p, s in zip(here, points[k], step, strict=True))
        return k + (behind - before) * ahead / length2

    def _row(self, queue: int, number: int, members: int) -> Row:
        """Return a queue's row, as far as a number if there are so many slots."""
        if self.closed[queue]:
            room = self.formation.queues[queue].room or 0
            return self._closed_row(queue, min(max(1, members), room))
        row = self._open_rows[queue]
        if len(row.slots) < number:
            self._extend(queue, row, min(number, MAX_TEAM))
        return row

    def _extend(self, queue: int, row: Row, count: int) -> None:
        """Add slots to an open queue's row until there are so many, as far as there are any."""
        while len(row.slots) < count:
            slot = self.formation.slot(self.place(queue, len(row.slots) + 1), 0)
            if slot is None:
                break
            row.append(slot)

    def _measured_row(self, queue: int, members: int) -> Row:
        arc_lengths = self.formation.queues[queue].members(members)
        slots = [self.formation.slot_at(queue, s) for s in arc_lengths]
        return Row([slot for slot in slots if slot is not None])

    def _blocked_numbers(self, queue: int, blocked: frozenset[Place]) -> frozenset[int]:
        """Return the numbers of a queue's members whose places are blocked."""
        return frozenset(
            [
                number
                for place in blocked
                if place.queue == queue and (number := self.number(place)) > 0
            ]
        )

    def _members(self, agents: int, blocked: frozenset[Place] = NO_PLACES) -> tuple[int, ...]:
        """Return how many members each queue gets besides those in vertices, in a team."""
        own = [0] * self.queues
        for place in self.vertex_places:
            if place not in self._common and place not in blocked:
                own[place.queue] += 1
        counts = self.formation.divide(agents, blocked)
        return tuple(max(0, count - held) for count, held in zip(counts, own, strict=True))

    def _led(self, agents: int, blocked: frozenset[Place] = NO_PLACES) -> tuple[int, ...]:
        """Return the vertices that somebody is to lead: those available, in a team of that many.

        A team that is smaller than the number of vertices leaves some empty. agents: 0 where
        nobody has counted.
        """
        small = 0 < agents < self.vertices
        filled = self.formation.layout(agents, blocked).slots if small else self.vertex_of
        return tuple(
            [
                v
                for v, place in enumerate(self.vertex_places)
                if place not in blocked and place in filled
            ]
        )


map_of = lru_cache(MAPS_KEPT)(QueueMap)
