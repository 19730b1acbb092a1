"""Formations: Definition 3. The places of a team, not which agent takes which place.

The ``...Spec`` structures are the tables of a formation file. :class:`Formation` is the geometry
that agents compute with, and a :class:`Layout` is a formation filled by a team of one size.
"""

from collections.abc import Sequence
from functools import cache
from math import dist, inf
from typing import Annotated, NamedTuple

import msgspec
from msgspec import Meta

from agent.messages import Metres, Place, Vector
from agent.qstructure.curve import CurveError
from agent.qstructure.expression import ExpressionError
from agent.qstructure.orientation import (
    Attitude,
    Orientation,
    OrientationError,
    OrientationSpec,
)
from agent.qstructure.queue import Queue, QueueError
from agent.qstructure.shape import ShapeError, ShapeSpec, Straight, shape_of

Name = Annotated[str, Meta(min_length=1, max_length=64)]
NO_PLACES: frozenset[Place] = frozenset()


class FormationError(ValueError):
    """A formation that cannot be flown; ``key`` is the offending key."""

    def __init__(self, key: str, detail: str) -> None:
        super().__init__(f"{key}: {detail}")
        self.key = key
        self.detail = detail


class QueueSpec(msgspec.Struct, frozen=True, forbid_unknown_fields=True, omit_defaults=True):
    """A queue's table: Q_j = (V_j, S_j, C_j, O_j) of Definition 4.

    vertices: names, one for an open queue, more for a closed one. shape: a closed queue without a
    shape runs straight from vertex to vertex. capacity: share of the team; left out: equal shares.
    orientation: left out: free.
    """

    name: Name
    vertices: Annotated[tuple[Name, ...], Meta(min_length=1, max_length=64)]
    shape: ShapeSpec | None = None
    capacity: Annotated[float, Meta(gt=0, le=1)] | None = None
    orientation: OrientationSpec | None = None


class FormationSpec(msgspec.Struct, frozen=True, forbid_unknown_fields=True, omit_defaults=True):
    """A formation file: F = (Q, V_F) of Definition 3; vertices [m; target's frame]."""

    name: Name
    vertices: Annotated[
        dict[Name, tuple[Metres, Metres, Metres]], Meta(min_length=1, max_length=64)
    ]
    queue: Annotated[tuple[QueueSpec, ...], Meta(min_length=1, max_length=64)]


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
    Raises :class:`FormationError` if the tables contradict each other.
    """

    def __init__(self, spec: FormationSpec, spacing: float) -> None:
        self.name = spec.name
        _check_names(spec)
        self.vertices = dict(spec.vertices)
        self.capacities = _capacities(spec)
        self.queues = tuple(_queue(table, self.vertices, spacing) for table in spec.queue)
        self._vertices_of = [table.vertices for table in spec.queue]
        holders = self._holders()
        self.vertex_places = {name: places[0] for name, places in holders.items()}
        self.common = tuple(places[0] for places in holders.values() if len(places) > 1)
        self._own = self._own_vertices(holders)
        self._queues_of_vertex: dict[tuple[int, int], frozenset[int]] = {
            places[0]: frozenset(place.queue for place in places) for places in holders.values()
        }
        self.layout = cache(self._layout)

    def slot(self, place: Place, agents: int) -> Slot | None:
        """Return a place's slot in a team of that size; None if there is no such place.

        On an open queue a place's slot does not depend on the size of the team.
        """
        found = self.layout(agents).slots.get(place)
        if found is not None:
            return found
        if not 0 <= place.queue < len(self.queues) or place.rank < 1:
            return None
        if self.queues[place.queue].closed:
            return None
        return self._slot(place.queue, self.queues[place.queue].members(place.rank)[-1])

    def queues_of(self, place: Place | tuple[int, int]) -> frozenset[int]:
        """Return the queues that a place belongs to; for a vertex, all that pass through it."""
        return self._queues_of_vertex.get(place) or frozenset(place[:1])

    def divide(self, agents: int, blocked: frozenset[Place] = NO_PLACES) -> tuple[int, ...]:
        """Return how many agents each queue gets besides those of shared vertices.

        Vertices come first, then the largest remainder over the capacities; ties go to the queue
        named first (E16). What a closed queue cannot hold goes to queues that can. blocked: places
        that are not available, since an unidentified vehicle hovers there (E18).
        """
        bounds = [self._capacity_of(j, blocked) for j in range(len(self.queues))]
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
        for _ in range(left - sum(counts)):
            free = [j for j in range(len(counts)) if counts[j] < bounds[j]]
            if not free:
                break
            lacking = {j: round(self.capacities[j] * left - counts[j], 9) for j in free}
            counts[max(free, key=lambda j: (lacking[j], -j))] += 1
        return tuple(counts)

    def check(self, agents: int, least_m: float) -> None:
        """Raise FormationError unless a team of that size fits, its slots ``least_m`` [m] apart."""
        layout = self._checked_layout(agents)
        if layout.unplaced:
            raise FormationError(
                "queue",
                f"all queues are closed and full: {layout.unplaced} of {agents} agents find no "
                "place; add an open queue, or take fewer agents",
            )
        wanted = self._divide(agents, [inf] * len(self.queues))
        for j, queue in enumerate(self.queues):
            if wanted[j] > self._capacity_of(j):
                raise FormationError(
                    f"queue {queue.name!r}",
                    f"its capacity asks for {wanted[j]} members, {self._capacity_of(j):g} fit",
                )
            self._check_shape(queue, layout)
        _check_apart(layout, self.queues, least_m)

    def _check_shape(self, queue: Queue, layout: Layout) -> None:
        used = [
            slot.arc_length
            for place, slot in layout.slots.items()
            if self.queues[place.queue] is queue
        ]
        try:
            queue.check(max(used, default=0.0))
        except (CurveError, ExpressionError) as error:
            raise FormationError(f"queue {queue.name!r}, shape", str(error)) from error

    def _checked_layout(self, agents: int) -> Layout:
        try:
            return self.layout(agents)
        except (CurveError, ExpressionError) as error:
            raise FormationError("queue", str(error)) from error

    def _layout(self, agents: int, blocked: frozenset[Place] = NO_PLACES) -> Layout:
        counts = self.divide(agents, blocked)
        common = _without(self.common, blocked)[:agents]
        ordered = [(0, 0, place) for place in common]
        heads = {*common}
        slots = {place: self._station(place) for place in common}
        for j, queue in enumerate(self.queues):
            own = _without(self._own[j], blocked)[: counts[j]]
            members = self._members(j, counts[j] - len(own), blocked)
            arc_lengths = queue.members(
                members[-1].rank + 1 - len(queue.stations) if members else 0
            )
            slots |= {place: self._station(place) for place in own}
            slots |= {
                place: self._slot(j, arc_lengths[place.rank - len(queue.stations)])
                for place in members
            }
            ordered += [(0, 1, place) for place in own]
            ordered += [(1 + k, j, place) for k, place in enumerate(members)]
            heads.update(own if self._has_vertex(j, blocked) else members[:1])
        ordered.sort()
        places = tuple(place for _, _, place in ordered)
        return Layout(places, slots, agents - len(places), frozenset(heads))

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

    def _station(self, place: Place) -> Slot:
        return self._slot(place.queue, self.queues[place.queue].stations[place.rank])

    def _slot(self, queue: int, s: float) -> Slot:
        where = self.queues[queue]
        try:
            return Slot(where.point(s), s, where.attitude(s))
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

    def _capacity_of(self, queue: int, blocked: frozenset[Place] = NO_PLACES) -> float:
        """Return how many agents a queue can hold besides those of shared vertices."""
        room = self.queues[queue].room
        if room is None:
            return inf
        lost = sum(place.queue == queue and place not in self.common for place in blocked)
        return max(0, len(self._own[queue]) + room - lost)


def _without(places: Sequence[Place], blocked: frozenset[Place]) -> list[Place]:
    return [place for place in places if place not in blocked]


def _queue(table: QueueSpec, vertices: dict[str, Vector], spacing: float) -> Queue:
    """Return a queue's geometry; raise FormationError with the queue's name."""
    through = [vertices[name] for name in table.vertices]
    label = f"queue {table.name!r}"
    if table.shape is None and len(through) == 1:
        raise FormationError(f"{label}, shape", "an open queue needs a shape")
    try:
        shape = shape_of(table.shape) if table.shape is not None else Straight(through)
        orientation = Orientation(table.orientation) if table.orientation is not None else None
        return Queue(table.name, through, shape, spacing, orientation)
    except (ShapeError, OrientationError, QueueError) as error:
        part = {ShapeError: "shape", OrientationError: "orientation"}.get(type(error))
        key = ".".join(each for each in (part, error.key) if each)
        raise FormationError(f"{label}, {key}", str(error)) from error
    except (CurveError, ExpressionError) as error:
        raise FormationError(f"{label}, shape", str(error)) from error


def _check_names(spec: FormationSpec) -> None:
    seen: set[str] = set()
    for index, queue in enumerate(spec.queue):
        if queue.name in seen:
            raise FormationError(f"queue[{index}].name", f"{queue.name!r} is used twice")
        seen.add(queue.name)
        for vertex in queue.vertices:
            if vertex not in spec.vertices:
                known = ", ".join(spec.vertices)
                raise FormationError(
                    f"queue[{index}].vertices", f"no vertex {vertex!r}; there are {known}"
                )
        if len(set(queue.vertices)) < len(queue.vertices):
            raise FormationError(f"queue[{index}].vertices", "a vertex is named twice")
    used = {vertex for queue in spec.queue for vertex in queue.vertices}
    for name in spec.vertices:
        if name not in used:
            raise FormationError(f"vertices.{name}", "no queue passes through it")


def _capacities(spec: FormationSpec) -> tuple[float, ...]:
    """Return each queue's share; queues without a capacity share the rest equally."""
    given = [queue.capacity for queue in spec.queue]
    total = sum(share for share in given if share is not None)
    missing = given.count(None)
    if missing and total < 1.0 - 1e-6:
        return tuple((1.0 - total) / missing if share is None else share for share in given)
    if missing or abs(total - 1.0) > 1e-6:
        raise FormationError("queue.capacity", f"the sum must be 1 within 1e-6; it is {total:g}")
    return tuple(share for share in given if share is not None)


def _check_apart(layout: Layout, queues: tuple[Queue, ...], least_m: float) -> None:
    placed = [(place, layout.slots[place].point) for place in layout.places]
    for index, (place, point) in enumerate(placed):
        for other, there in placed[:index]:
            apart = dist(point, there)
            if apart < least_m - 1e-9:
                names = sorted({queues[place.queue].name, queues[other.queue].name})
                raise FormationError(
                    f"queue {' and '.join(map(repr, names))}",
                    f"two of its slots are {apart:.3f} m apart; at least {least_m:g} m is required",
                )
