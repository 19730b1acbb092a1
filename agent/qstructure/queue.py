"""Queues: the positions of a queue's members by arc length (Definition 4).

An open queue has one vertex and no end; its members stand d_ir apart. A closed queue passes through
two or more vertices; its members stand evenly between them, never closer than d_ir.
"""

from itertools import pairwise
from math import dist

from agent.messages import Vector
from agent.qstructure.curve import CurveError
from agent.qstructure.expression import ExpressionError
from agent.qstructure.orientation import FREE, Attitude, Orientation
from agent.qstructure.shape import Shape, Straight

ON_CURVE_M = 1e-3
"""A shape passes through a vertex if it comes nearer than this."""
SEARCH_STEP_M = 0.01
ADDED_STEPS = 10_000
"""So many steps of a search are added one by one, so that its points are multiples of a step."""
DETOUR = 50.0
"""A vertex is searched for over so many times its straight distance."""
SEARCH_STEPS = 20_000
"""Most steps of the search for a vertex, if no other is searched for."""


class QueueError(ValueError):
    """A queue that cannot hold its members; ``key`` is the offending key."""

    def __init__(self, key: str, detail: str) -> None:
        super().__init__(detail)
        self.key = key


class Queue:
    """One queue's geometry, with ``stations``: the arc lengths of its vertices [m].

    vertices: those it passes through, in order [m; target's frame]; spacing: d_ir [m];
    search_steps: most steps in the search for each vertex. Raises QueueError if the shape misses a
    vertex or two vertices are less than d_ir apart.
    """

    def __init__(
        self,
        name: str,
        vertices: list[Vector],
        shape: Shape | Straight,
        spacing: float,
        orientation: Orientation | None = None,
        search_steps: int = SEARCH_STEPS,
    ) -> None:
        self.name = name
        self._search_steps = search_steps
        self._origin = vertices[0]
        self._shape = shape
        self._spacing = spacing
        self._orientation = orientation
        self._usable = 0
        """Number of members of an open queue that are known to be computable."""
        self._ended = False
        """Whether the next one is known not to be."""
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
        """Raise CurveError or ExpressionError if the shape cannot be followed up to s [m]."""
        self._shape.check(s)

    def members(self, count: int) -> list[float]:
        """Return the arc lengths of ``count`` members besides the vertices [m]."""
        if self.closed:
            return self._between(count)
        return [self.behind(rank + 1) for rank in range(count)]

    def behind(self, rank: int) -> float:
        """Return the arc length of an open queue's member of that rank [m].

        s_i = s_k + d_ir, by arc length, not by the chord (E13).
        """
        return self._spacing * rank

    def usable(self, count: int) -> int:
        """Return how many of the first ``count`` members of an open queue can be computed."""
        while self._usable < count and not self._ended:
            try:
                self.point(self.behind(self._usable + 1))
            except (CurveError, ExpressionError):
                self._ended = True
            else:
                self._usable += 1
        return min(self._usable, count)

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
        best = self._closest(vertex, self._first_near(vertex, start))
        least = dist(self.point(best), vertex)
        if least > ON_CURVE_M:
            raise QueueError("shape", f"it misses its vertex at {vertex} by {least:.3f} m")
        if best - start < self._spacing * (1.0 - 1e-9):
            raise QueueError(
                "vertices",
                f"too short: {best - start:.3f} m between two vertices, {self._spacing:g} m needed",
            )
        return best

    def _first_near(self, vertex: Vector, start: float) -> float:
        """Return the arc length after ``start`` at which the shape first comes near a vertex [m].

        A curve ``away`` from the vertex does not reach it within so many metres, so the search
        need not look there.
        """
        limit = start + DETOUR * (dist(self.point(start), vertex) + 1.0)
        s, best, least = start + SEARCH_STEP_M, start, float("inf")
        for _ in range(self._search_steps):
            here = self._shape.within(min(s, limit))
            if s >= here + SEARCH_STEP_M:
                break
            away = dist(self.point(here), vertex)
            if away < least:
                best, least = here, away
            elif least < SEARCH_STEP_M:
                break
            s = _farther(s, int(away / SEARCH_STEP_M) - 1)
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


def _farther(s: float, steps: int) -> float:
    """Return an arc length that is at least one step of the search farther [m]."""
    if steps > ADDED_STEPS:
        return s + steps * SEARCH_STEP_M
    for _ in range(max(steps, 1)):
        s += SEARCH_STEP_M
    return s
