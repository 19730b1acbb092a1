"""Formations: Definition 3. The places of a team, not which agent takes which place.

:class:`Formation` is the geometry that agents compute with, and a :class:`Layout` is a formation
filled by a team of one size. The tables of a formation file are in ``formation_tables``.
"""

from collections.abc import Sequence
from functools import lru_cache
from itertools import product
from math import dist, inf
from typing import Final, NamedTuple

import msgspec

from agent.messages import MAX_TEAM, Place, Vector
from agent.qstructure.curve import CurveError
from agent.qstructure.expression import ExpressionError
from agent.qstructure.formation_tables import (
    FormationError,
    FormationSpec,
    Name,
    QueueSpec,
    capacities_of,
    check_names,
    queues_of,
)
from agent.qstructure.orientation import FREE, Attitude, OrientationError
from agent.qstructure.queue import Queue

__all__ = [
    "Formation",
    "FormationError",
    "FormationSpec",
    "Layout",
    "Name",
    "QueueSpec",
    "Slot",
    "formation_of",
]

NO_PLACES: frozenset[Place] = frozenset()
MAX_RANK = 2 * MAX_TEAM
"""A place of a higher rank is none: no team reaches it, and to measure its queue takes long."""
LAYOUTS_KEPT: Final = 128
FORMATIONS_KEPT: Final = 32


class Slot(NamedTuple):
    """The geometry of a place."""

    point: Vector  # [m; target's frame]
    arc_length: float  # from the queue's first vertex [m]
    attitude: Attitude


class Layout(NamedTuple):
    """A formation filled by a team of one size."""

    places: tuple[Place, ...]  # in the order in which they fill
    slots: dict[Place, Slot]
    unplaced: int  # agents without a place, because every queue is closed and full
    heads: frozenset[Place]  # places whose holders are queue-vertex agents


class Formation:
    """The geometry of a formation, d_ir = ``spacing`` [m], and a team's division over its queues.

    A place is (queue, rank): the ranks of a queue's vertices come first, in order, then its members
    along the curve. A vertex shared by several queues is one place, of the first of these queues.
    A slot that cannot be computed, behind a pole say, is no place, and an angle that cannot be
    computed is free: ``check`` refuses both, but a team may grow after it. Raises
    :class:`FormationError` if the tables contradict each other.
    """

    def __init__(self, spec: FormationSpec, spacing: float) -> None:
        self.name = spec.name
        self.oriented = spec.oriented
        check_names(spec)
        self.vertices = dict(spec.vertices)
        self.capacities = capacities_of(spec)
        self.queues = queues_of(spec, spacing)
        self._vertices_of = [table.vertices for table in spec.queue]
        holders = self._holders()
        self.vertex_places = {name: places[0] for name, places in holders.items()}
        self.common = tuple(places[0] for places in holders.values() if len(places) > 1)
        self._own = self._own_vertices(holders)
        self._queues_of_vertex: dict[tuple[int, int], frozenset[int]] = {
            places[0]: frozenset(place.queue for place in places) for places in holders.values()
        }
        self.layout = lru_cache(LAYOUTS_KEPT)(self._layout)

    def slot(self, place: Place, agents: int) -> Slot | None:
        """Return a place's slot in a team of that size; None if there is no such place.

        On an open queue a place's slot does not depend on the size of the team.
        """
        found = self.layout(agents).slots.get(place)
        if found is not None:
            return found
        if not 0 <= place.queue < len(self.queues) or place.rank < 1:
            return None
        queue = self.queues[place.queue]
        if queue.closed or place.rank > MAX_RANK or queue.usable(place.rank) < place.rank:
            return None
        return self.slot_at(place.queue, queue.behind(place.rank))

    def queues_of(self, place: Place | tuple[int, int]) -> frozenset[int]:
        """Return the queues that a place belongs to; for a vertex, all that pass through it."""
        return self._queues_of_vertex.get(place) or frozenset(place[:1])

    def first_vertex_of(self, queue: int) -> str:
        """Return the name of a queue's first vertex."""
        return self._vertices_of[queue][0]

    def divide(self, agents: int, blocked: frozenset[Place] = NO_PLACES) -> tuple[int, ...]:
        """Return how many agents each queue gets besides those of shared vertices.

        Vertices come first, then the largest remainder over the capacities; ties go to the queue
        named first (E16). What a closed queue cannot hold goes to queues that can. blocked: places
        that are not available, since an unidentified vehicle hovers there (E18).
        """
        queues = range(len(self.queues))
        bounds = [self._capacity_of(j, agents + len(blocked), blocked) for j in queues]
        return self._divide(agents, bounds, blocked)

    def _divide(
        self, agents: int, bounds: list[float], blocked: frozenset[Place] = NO_PLACES
    ) -> tuple[int, ...]:
        """Divide with a bound for each queue.

        One agent after another goes to the queue that lacks most: the method of largest remainders,
        with bounds.
        """
        left = max(0, agents - len(_without(self.common, blocked)))
        owned = [len(_without(own, blocked)) for own in self._own]
        counts = owned if left >= sum(owned) else [0] * len(bounds)
        asked = [capacity * left for capacity in self.capacities]
        lacking = [round(each - counts[j], 9) for j, each in enumerate(asked)]
        for _ in range(left - sum(counts)):
            most = -1
            for j, bound in enumerate(bounds):
                if counts[j] < bound and (most < 0 or lacking[j] > lacking[most]):
                    most = j
            if most < 0:
                break
            counts[most] += 1
            lacking[most] = round(asked[most] - counts[most], 9)
        return tuple(counts)

    def check(self, agents: int, least_m: float) -> None:
        """Raise FormationError unless a team of that size fits, its slots ``least_m`` [m] apart."""
        wanted = self._divide(agents, [inf] * len(self.queues))
        for j, queue in enumerate(self.queues):
            if not queue.closed:
                self._check_members(j, wanted[j] - len(self._own[j]))
        layout = self.layout(agents)
        if layout.unplaced:
            raise FormationError(
                "queue",
                f"all queues are closed and full: {layout.unplaced} of {agents} agents find no "
                "place; add an open queue, or take fewer agents",
            )
        for j, queue in enumerate(self.queues):
            room = self._capacity_of(j, agents)
            if wanted[j] > room:
                raise FormationError(
                    f"queue {queue.name!r}",
                    f"its capacity asks for {wanted[j]} members, {room:g} fit",
                )
            self._check_shape(queue, layout)
        _check_apart(layout, self.queues, least_m)

    def reach_m(self, agents: int) -> float:
        """Return how far from the frame's origin a slot of so many agents can be at most [m]."""
        return max(
            dist((0.0, 0.0, 0.0), queue.point(0.0))
            + (queue.stations[-1] if queue.closed else queue.behind(agents))
            for queue in self.queues
        )

    def _check_members(self, queue: int, count: int) -> None:
        """Raise FormationError unless an open queue's first members can be computed."""
        for s in self.queues[queue].members(count):
            self._computed(queue, s)

    def _check_shape(self, queue: Queue, layout: Layout) -> None:
        used = [
            slot.arc_length
            for place, slot in layout.slots.items()
            if self.queues[place.queue] is queue
        ]
        for s in used:
            self._computed(self.queues.index(queue), s)
        try:
            queue.check(max(used, default=0.0))
        except (CurveError, ExpressionError) as error:
            raise FormationError(f"queue {queue.name!r}, shape", str(error)) from error

    def _layout(self, agents: int, blocked: frozenset[Place] = NO_PLACES) -> Layout:
        counts = self.divide(agents, blocked)
        common = _without(self.common, blocked)[:agents]
        ordered = [(0, 0, place) for place in common]
        heads = {*common}
        found = {place: self._station(place) for place in common}
        for j, queue in enumerate(self.queues):
            own = _without(self._own[j], blocked)[: counts[j]]
            members = self._members(j, counts[j] - len(own), blocked)
            arc_lengths = queue.members(
                members[-1].rank + 1 - len(queue.stations) if members else 0
            )
            found |= {place: self._station(place) for place in own}
            found |= {
                place: self.slot_at(j, arc_lengths[place.rank - len(queue.stations)])
                for place in members
            }
            ordered += [(0, 1, place) for place in own]
            ordered += [(1 + k, j, place) for k, place in enumerate(members)]
            heads.update(own if self._has_vertex(j, blocked) else members[:1])
        ordered.sort()
        slots = {place: slot for place, slot in found.items() if slot is not None}
        places = tuple(place for _, _, place in ordered if place in slots)
        return Layout(places, slots, agents - len(places), frozenset(heads & slots.keys()))

    def _members(self, queue: int, count: int, blocked: frozenset[Place]) -> list[Place]:
        """Return the first ``count`` available places behind or between a queue's vertices."""
        first, found = len(self.queues[queue].stations), list[Place]()
        rank = first
        while len(found) < count:
            place = Place(queue, rank)
            if place not in blocked:
                found.append(place)
            rank += 1
        return found

    def _has_vertex(self, queue: int, blocked: frozenset[Place]) -> bool:
        """Whether one of a queue's vertices is available; else its first member is the head."""
        return any(
            queue in queues and place not in blocked
            for place, queues in self._queues_of_vertex.items()
        )

    def _station(self, place: Place) -> Slot | None:
        return self.slot_at(place.queue, self.queues[place.queue].stations[place.rank])

    def slot_at(self, queue: int, s: float) -> Slot | None:
        """Return the slot at an arc length [m]; None if its point cannot be computed."""
        where = self.queues[queue]
        try:
            point = where.point(s)
        except (CurveError, ExpressionError):
            return None
        try:
            return Slot(point, s, where.attitude(s))
        except OrientationError:
            return Slot(point, s, FREE)

    def _computed(self, queue: int, s: float) -> None:
        """Raise FormationError if a point or an angle at arc length s [m] cannot be computed."""
        where = self.queues[queue]
        try:
            where.point(s)
            where.attitude(s)
        except OrientationError as error:
            key = f"queue {where.name!r}, orientation.{error.key}"
            raise FormationError(key, str(error)) from error
        except (CurveError, ExpressionError) as error:
            raise FormationError(f"queue {where.name!r}, shape", str(error)) from error

    def _holders(self) -> dict[str, list[Place]]:
        """Return for each vertex its places, one in each queue that passes through it."""
        holders: dict[str, list[Place]] = {}
        for j, names in enumerate(self._vertices_of):
            for rank, name in enumerate(names):
                holders.setdefault(name, []).append(Place(j, rank))
        return holders

    def _own_vertices(self, holders: dict[str, list[Place]]) -> list[list[Place]]:
        """Return for each queue the places of the vertices that no other queue passes through."""
        own: list[list[Place]] = [[] for _ in self._vertices_of]
        for places in holders.values():
            if len(places) == 1:
                own[places[0].queue].append(places[0])
        return [sorted(places) for places in own]

    def _capacity_of(self, queue: int, agents: int, blocked: frozenset[Place] = NO_PLACES) -> float:
        """Return how many agents a queue can hold besides those of shared vertices.

        Infinite for an open queue with room for that many.
        """
        room = self.queues[queue].room
        if room is None:
            room = self.queues[queue].usable(agents)
            if room >= agents:
                return inf
        lost = sum(place.queue == queue and place not in self.common for place in blocked)
        return max(0, len(self._own[queue]) + room - lost)


@lru_cache(FORMATIONS_KEPT)
def _formation_of(encoded: bytes, spacing: float) -> Formation:
    return Formation(msgspec.msgpack.decode(encoded, type=FormationSpec), spacing)


def formation_of(spec: FormationSpec, spacing: float) -> Formation:
    """Return a formation's geometry, the same object for equal tables. Raises FormationError."""
    return _formation_of(msgspec.msgpack.encode(spec), spacing)


def _without(places: Sequence[Place], blocked: frozenset[Place]) -> list[Place]:
    return [place for place in places if place not in blocked]


def _check_apart(layout: Layout, queues: tuple[Queue, ...], least_m: float) -> None:
    """Raise FormationError for two slots that are too near; only near ones are compared."""
    cells: dict[tuple[int, int, int], list[Place]] = {}
    for place in layout.places:
        point = layout.slots[place].point
        x, y, z = (int(each // least_m) for each in point)
        for cell in product((x - 1, x, x + 1), (y - 1, y, y + 1), (z - 1, z, z + 1)):
            for other in cells.get(cell, ()):
                apart = dist(point, layout.slots[other].point)
                if apart < least_m - 1e-9:
                    names = sorted({queues[place.queue].name, queues[other.queue].name})
                    raise FormationError(
                        f"queue {' and '.join(map(repr, names))}",
                        f"two of its slots are {apart:.3f} m apart; at least {least_m:g} m is"
                        " required",
                    )
        cells.setdefault((x, y, z), []).append(place)
