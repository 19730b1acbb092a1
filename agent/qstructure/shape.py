"""Shapes of queues, by arc length: S_j of Definition 4.

A shape starts at the origin; a queue puts that origin on its first vertex. An open shape goes on
for ever: past its last point it continues straight.
"""

import itertools
from bisect import bisect_right
from math import sqrt
from typing import Annotated, Protocol

import msgspec
from msgspec import Meta

from agent.messages import Metres, Vector

Triple = tuple[Metres, Metres, Metres]


class ShapeError(ValueError):
    """A shape that no agent could stand on; the text says why, ``key`` where."""

    def __init__(self, key: str, detail: str) -> None:
        super().__init__(detail)
        self.key = key


class Ray(msgspec.Struct, frozen=True, forbid_unknown_fields=True, tag="ray", tag_field="kind"):
    """A straight line from the vertex on. ``direction`` need not be of unit length."""

    direction: Triple


class Polyline(
    msgspec.Struct, frozen=True, forbid_unknown_fields=True, tag="polyline", tag_field="kind"
):
    """Straight pieces from point to point [m], shifted so that the first lies on the vertex."""

    points_m: Annotated[tuple[Triple, ...], Meta(min_length=2, max_length=256)]


ShapeSpec = Ray | Polyline


class Shape(Protocol):
    """A curve by arc length."""

    def point(self, s: float) -> Vector:
        """Return the point at arc length s >= 0 [m] from the vertex, relative to it [m]."""


class _Pieces:
    """Straight pieces; the last one goes on for ever."""

    def __init__(self, corners: list[Vector]) -> None:
        self._corners = corners
        self._units: list[Vector] = []
        self._starts = [0.0]
        for a, b in itertools.pairwise(corners):
            step = (b[0] - a[0], b[1] - a[1], b[2] - a[2])
            length = _length(step)
            self._units.append((step[0] / length, step[1] / length, step[2] / length))
            self._starts.append(self._starts[-1] + length)

    def point(self, s: float) -> Vector:
        piece = min(max(bisect_right(self._starts, s) - 1, 0), len(self._units) - 1)
        corner, unit = self._corners[piece], self._units[piece]
        along = s - self._starts[piece]
        return (
            corner[0] + along * unit[0],
            corner[1] + along * unit[1],
            corner[2] + along * unit[2],
        )


def shape_of(spec: ShapeSpec) -> Shape:
    """Return the curve that a shape's table describes, or raise :class:`ShapeError`."""
    if isinstance(spec, Ray):
        if _length(spec.direction) < 1e-9:
            raise ShapeError("direction", "must not be of zero length")
        return _Pieces([(0.0, 0.0, 0.0), spec.direction])
    first = spec.points_m[0]
    corners = [(p[0] - first[0], p[1] - first[1], p[2] - first[2]) for p in spec.points_m]
    for index, (a, b) in enumerate(itertools.pairwise(corners)):
        if _length((b[0] - a[0], b[1] - a[1], b[2] - a[2])) < 1e-9:
            raise ShapeError("points_m", f"points {index} and {index + 1} must not coincide")
    return _Pieces(corners)


def _length(v: Vector) -> float:
    return sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2])
