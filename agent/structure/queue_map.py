"""A formation as its members count it: queues, the vertices they begin at, and numbered members.

The members of a queue besides those in vertices are numbered from 1, outwards from the queue's
first vertex, its *home*. A number is a place's rank, counted from the first rank that is no vertex.
"""

from collections.abc import Iterable, Sequence
from functools import lru_cache
from math import dist
from typing import NamedTuple

from agent.messages import MAX_TEAM, Place, Vector
from agent.qstructure.formation import NO_PLACES, Formation, Slot

MAPS_KEPT = 16


class Nearest(NamedTuple):
    """The nearest of a queue's first members."""

    number: int
    away_m: float


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
        self._open_slots: list[list[Slot]] = [[] for _ in numbers]
        self.members = lru_cache(maxsize=64)(self._members)
        self._slots_between = lru_cache(maxsize=64)(self._measured_between)

    def is_common(self, vertex: int) -> bool:
        """Whether several queues share a vertex."""
        return self.vertex_places[vertex] in self._common

    def place(self, queue: int, number: int) -> Place:
        """Return the place of a queue's member."""
        return Place(queue, self._first_rank[queue] - 1 + number)

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
            through = [j for j in range(self.queues) if v in self.vertices_of[j]]
            if not any(counts[j] for j in through):
                wanted[through[0]] += 1
        return tuple(wanted)

    def blocked_numbers(self, queue: int, blocked: Iterable[Place]) -> frozenset[int]:
        """Return the numbers of a queue's members whose places are blocked."""
        return frozenset(
            [
                number
                for place in blocked
                if place.queue == queue and (number := self.number(place)) > 0
            ]
        )

    def vertex_slot(self, vertex: int) -> Slot | None:
        """Return a vertex's slot."""
        place = self.vertex_places[vertex]
        return self.formation.slot_at(
            place.queue, self.formation.queues[place.queue].stations[place.rank]
        )

    def slot(self, queue: int, number: int, members: int) -> Slot | None:
        """Return a member's slot; None where there is none.

        members: of the queue; those of a closed one share its length.
        """
        if number < 1:
            return None
        if self.closed[queue]:
            room = self.formation.queues[queue].room or 0
            slots = self._slots_between(queue, min(max(1, members), room))
        else:
            slots = self._slots_behind(queue, min(number, MAX_TEAM))
        return slots[number - 1] if number <= len(slots) else None

    def nearest(self, queue: int, members: int, here: Vector) -> Nearest | None:
        """Return the nearest of a queue's first members. here [m; target's frame]."""
        found = None
        for number in range(1, max(members, 1) + 1):
            slot = self.slot(queue, number, members)
            if slot is None:
                break
            away_m = dist(slot.point, here)
            if found is None or away_m < found.away_m:
                found = Nearest(number, away_m)
        return found

    def _slots_behind(self, queue: int, count: int) -> list[Slot]:
        """Return at least the first ``count`` slots of an open queue, as far as there are any."""
        slots = self._open_slots[queue]
        while len(slots) < count:
            slot = self.formation.slot(self.place(queue, len(slots) + 1), 0)
            if slot is None:
                break
            slots.append(slot)
        return slots

    def _measured_between(self, queue: int, members: int) -> list[Slot]:
        arc_lengths = self.formation.queues[queue].members(members)
        slots = [self.formation.slot_at(queue, s) for s in arc_lengths]
        return [slot for slot in slots if slot is not None]

    def _members(self, agents: int, blocked: frozenset[Place] = NO_PLACES) -> tuple[int, ...]:
        """Return how many members each queue gets besides those in vertices, in a team."""
        own = [0] * self.queues
        for place in self.vertex_places:
            if place not in self._common and place not in blocked:
                own[place.queue] += 1
        counts = self.formation.divide(agents, blocked)
        return tuple(max(0, count - held) for count, held in zip(counts, own, strict=True))


map_of = lru_cache(MAPS_KEPT)(QueueMap)
