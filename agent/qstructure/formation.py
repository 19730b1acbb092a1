"""Formations and queues: Definitions 3 and 4.

A formation says what a team looks like, not who stands where: queues with a shape and a share of
the team, anchored on vertices. The ``...Spec`` structures are the tables of a formation file;
:class:`Formation` is what agents compute with.
"""

from functools import cache
from typing import Annotated

import msgspec
from msgspec import Meta

from agent.messages import Metres, Place, Vector
from agent.qstructure.shape import Shape, ShapeError, ShapeSpec, shape_of

Name = Annotated[str, Meta(min_length=1, max_length=64)]


class FormationError(ValueError):
    """A formation that cannot be flown; ``key`` names the offending key."""

    def __init__(self, key: str, detail: str) -> None:
        super().__init__(f"{key}: {detail}")
        self.key = key
        self.detail = detail


class QueueSpec(msgspec.Struct, frozen=True, forbid_unknown_fields=True, omit_defaults=True):
    """A queue's table: Q_j = (V_j, S_j, C_j) of Definition 4.

    vertices: names; one for an open queue. capacity: share of the team, left out: equal shares.
    """

    name: Name
    vertices: Annotated[tuple[Name, ...], Meta(min_length=1, max_length=1)]
    shape: ShapeSpec
    capacity: Annotated[float, Meta(gt=0, le=1)] | None = None


class FormationSpec(msgspec.Struct, frozen=True, forbid_unknown_fields=True, omit_defaults=True):
    """A formation's file: F = (Q, V_F) of Definition 3; vertices [m; target's frame]."""

    name: Name
    vertices: Annotated[
        dict[Name, tuple[Metres, Metres, Metres]], Meta(min_length=1, max_length=64)
    ]
    queue: Annotated[tuple[QueueSpec, ...], Meta(min_length=1, max_length=64)]


class Queue:
    """An open queue: a vertex and a shape that starts on it."""

    __slots__ = ("_shape", "_vertex", "capacity", "first_rank", "name")

    def __init__(
        self, name: str, vertex: Vector, shape: Shape, capacity: float, first_rank: int
    ) -> None:
        self.name = name
        self.capacity = capacity
        self.first_rank = first_rank
        self._vertex = vertex
        self._shape = shape

    def point(self, s: float) -> Vector:
        """Return the point at arc length s [m] from the vertex [m; target's frame]."""
        x, y, z = self._shape.point(s)
        return (self._vertex[0] + x, self._vertex[1] + y, self._vertex[2] + z)


class Formation:
    """The geometry of a formation and the division of a team over its queues.

    ``first_rank`` of a queue is 0, or 1 where its vertex is held in common and counted elsewhere.
    Raises :class:`FormationError` when the tables contradict themselves.
    """

    def __init__(self, spec: FormationSpec) -> None:
        self.name = spec.name
        self.vertices = tuple(spec.vertices)
        _check_names(spec)
        shares = _capacities(spec)
        holders: dict[str, list[int]] = {name: [] for name in spec.vertices}
        for index, table in enumerate(spec.queue):
            holders[table.vertices[0]].append(index)
        self.common = tuple(Place(who[0], 0) for who in holders.values() if len(who) > 1)
        self.vertex_places = {name: Place(who[0], 0) for name, who in holders.items() if who}
        self.queues = tuple(
            Queue(
                table.name,
                spec.vertices[table.vertices[0]],
                _shape(index, table),
                shares[index],
                1 if len(holders[table.vertices[0]]) > 1 else 0,
            )
            for index, table in enumerate(spec.queue)
        )
        self.places = cache(self._places)

    def slot(self, place: Place, spacing: float) -> Vector:
        """Return where a place is [m; target's frame], ``spacing`` = d_ir [m] along the queue.

        By arc length, s = rank * d_ir (E13); never by the chord.
        """
        return self.queues[place.queue].point(place.rank * spacing)

    def holds(self, place: Place) -> bool:
        """Whether this is a place of the formation, and its first name."""
        if not 0 <= place.queue < len(self.queues) or place.rank < 0:
            return False
        return place.rank >= self.queues[place.queue].first_rank or place in self.common

    def divide(self, agents: int) -> tuple[int, ...]:
        """Return how many agents each queue gets besides the common ones of shared vertices.

        Largest remainder over the capacities, ties to the queue named first (E16).
        """
        free = max(0, agents - len(self.common))
        quotas = [queue.capacity * free for queue in self.queues]
        counts = [int(quota + 1e-9) for quota in quotas]
        order = sorted(range(len(quotas)), key=lambda j: (-round(quotas[j] - counts[j], 9), j))
        for j in order[: free - sum(counts)]:
            counts[j] += 1
        return tuple(counts)

    def _places(self, agents: int) -> tuple[Place, ...]:
        """Return the places that ``agents`` agents fill: vertices first, then rank by rank."""
        counts = self.divide(agents)
        own = [
            Place(j, queue.first_rank + k)
            for j, queue in enumerate(self.queues)
            for k in range(counts[j])
        ]
        return (*self.common[:agents], *sorted(own, key=lambda place: (place.rank, place.queue)))


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
    used = {vertex for queue in spec.queue for vertex in queue.vertices}
    for name in spec.vertices:
        if name not in used:
            raise FormationError(f"vertices.{name}", "no queue starts at it")


def _capacities(spec: FormationSpec) -> tuple[float, ...]:
    """Return each queue's share; what is left out shares equally what the others leave."""
    given = [queue.capacity for queue in spec.queue]
    total = sum(share for share in given if share is not None)
    missing = given.count(None)
    if missing and total < 1.0 - 1e-6:
        return tuple((1.0 - total) / missing if share is None else share for share in given)
    if missing or abs(total - 1.0) > 1e-6:
        raise FormationError("queue.capacity", f"the sum must be 1 within 1e-6, it is {total:g}")
    return tuple(share for share in given if share is not None)


def _shape(index: int, queue: QueueSpec) -> Shape:
    try:
        return shape_of(queue.shape)
    except ShapeError as error:
        raise FormationError(f"queue[{index}].shape.{error.key}", str(error)) from error
