"""Queues: the positions of a queue's members by arc length (Definition 4).

An open queue has one vertex and no end; its members stand d_ir apart. A closed queue passes through
two or more vertices; its members stand evenly between them, never closer than d_ir.
"""

from itertools import pairwise
from math import dist

from agent.messages import Vector
from agent.qstructure.orientation import FREE, Attitude, Orientation
from agent.qstructure.shape import Shape, Straight

ON_CURVE_M = 1e-3
"""A shape passes through a vertex if it comes nearer than this."""
SEARCH_STEP_M = 0.01
DETOUR = 50.0
"""A vertex is searched for over so many times its straight distance."""


class QueueError(ValueError):
    """A queue that cannot hold its members; ``key`` is the offending key."""

    def __init__(self, key: str, detail: str) -> None:
        super().__init__(detail)
        self.key = key


class Queue:
    """One queue's geometry, with ``stations``: the arc lengths of its vertices [m].

    vertices: those it passes through, in order [m; target's frame]; spacing: d_ir [m]. Raises
    QueueError if the shape misses a vertex or two vertices are less than d_ir apart.
    """

    def __init__(
        self,
        name: str,
        vertices: list[Vector],
        shape: Shape | Straight,
        spacing: float,
        orientation: Orientation | None = None,
    ) -> None:
        self.name = name
        self._origin = vertices[0]
        self._shape = shape
        self._spacing = spacing
        self._orientation = orientation
        self.stations = [0.0]
        for vertex in vertices[1:]:
            self.stations.append(self._station(vertex))

    @property
    def closed(self) -> bool:
        """Whether the queue ends at a vertex, and so has a limited room."""
        return len(self.stations) > 1

    @property
    def room(self) -> int | None:
        """How many members fit between the vertices; None for an open queue, which has no limit."""
        if not self.closed:
            return None
        return sum(self._rooms())

    def point(self, s: float) -> Vector:
        """Return the point at arc length s [m] from the first vertex [m; target's frame]."""
        x, y, z = self._shape.point(s)
        return (self._origin[0] + x, self._origin[1] + y, self._origin[2] + z)

    def attitude(self, s: float) -> Attitude:
        """Return the attitude at arc length s [m]; raises OrientationError."""
        return self._orientation.at(s) if self._orientation is not None else FREE

    def check(self, s: float) -> None:
        """Raise CurveError if the shape cannot be followed up to arc length s [m]."""
        self._shape.check(s)

    def members(self, count: int) -> list[float]:
        """Return the arc lengths of ``count`` members besides the vertices [m]."""
        return self._between(count) if self.closed else self._behind(count)

    def _behind(self, count: int) -> list[float]:
        """Members of an open queue: s_i = s_k + d_ir, by arc length, not by the chord (E13)."""
        return [self._spacing * (index + 1) for index in range(count)]

    def _between(self, count: int) -> list[float]:
        """Members of a closed queue: each next one goes where there is most space."""
        rooms, lengths = self._rooms(), self._lengths()
        held = [0] * len(lengths)
        for _ in range(count):
            widest = max(
                (piece for piece, room in enumerate(rooms) if held[piece] < room),
                key=lambda piece: lengths[piece] / (held[piece] + 1),
            )
            held[widest] += 1
        return [
            start + length * (index + 1) / (number + 1)
            for start, length, number in zip(self.stations[:-1], lengths, held, strict=True)
            for index in range(number)
        ]

    def _lengths(self) -> list[float]:
        return [b - a for a, b in pairwise(self.stations)]

    def _rooms(self) -> list[int]:
        return [int(length / self._spacing + 1e-9) - 1 for length in self._lengths()]

    def _station(self, vertex: Vector) -> float:
        """Return the arc length at which the shape passes a vertex, after the last one [m]."""
        start = self.stations[-1]
        limit = min(self._shape.end, start + DETOUR * (dist(self.point(start), vertex) + 1.0))
        s, best, least = start + SEARCH_STEP_M, start, float("inf")
        while s < limit + SEARCH_STEP_M:
            away = dist(self.point(min(s, limit)), vertex)
            if away < least:
                best, least = min(s, limit), away
            elif least < SEARCH_STEP_M:
                break
            s += SEARCH_STEP_M
        best = self._closest(vertex, best)
        least = dist(self.point(best), vertex)
        if least > ON_CURVE_M:
            raise QueueError("shape", f"it misses its vertex at {vertex} by {least:.3f} m")
        if best - start < self._spacing * (1.0 - 1e-9):
            raise QueueError(
                "vertices",
                f"too short: {best - start:.3f} m between two vertices, {self._spacing:g} m needed",
            )
        return best

    def _closest(self, vertex: Vector, near: float) -> float:
        low, high = max(0.0, near - SEARCH_STEP_M), near + SEARCH_STEP_M
        for _ in range(60):
            a, b = low + (high - low) / 3.0, high - (high - low) / 3.0
            if dist(self.point(a), vertex) <= dist(self.point(b), vertex):
                high = b
            else:
                low = a
        return 0.5 * (low + high)
