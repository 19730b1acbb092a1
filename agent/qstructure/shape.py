"""Shapes of queues: S_j of Definition 4, each a curve by arc length.

A shape starts at the origin; a queue puts that origin on its first vertex. A shape that ends is
continued straight, in its last direction, since an open queue has no end.
"""

from bisect import bisect_right
from collections.abc import Callable
from itertools import pairwise
from math import cos, dist, hypot, inf, pi, radians, sin
from typing import Annotated, assert_never

import msgspec
from msgspec import Meta

from agent.messages import ZERO, Metres, Vector
from agent.qstructure.curve import FULL_EFFORT, PIECE_M, ArcLengthCurve, CurveError, Effort
from agent.qstructure.expression import MAX_EXPRESSION_LENGTH, Expression, ExpressionError

Triple = tuple[Metres, Metres, Metres]
LEAST_M = 1e-3
"""Least radius, and least distance between two points: what is smaller has no direction to fly."""
Length = Annotated[float, Meta(ge=LEAST_M, le=1e4)]
Degrees = Annotated[float, Meta(ge=-1e4, le=1e4)]
Points = Annotated[tuple[Triple, ...], Meta(min_length=2, max_length=256)]
Text = Annotated[str, Meta(min_length=1, max_length=MAX_EXPRESSION_LENGTH)]
AHEAD_M = 1e-4
"""How far before its end a curve's last direction is taken."""


class ShapeError(ValueError):
    """A shape that cannot hold a queue; ``key`` is the offending key."""

    def __init__(self, key: str, detail: str) -> None:
        super().__init__(detail)
        self.key = key


class _Spec(msgspec.Struct, frozen=True, forbid_unknown_fields=True, tag_field="kind"):
    """Base of the shapes' tables, which differ by ``kind``."""


class Ray(_Spec, frozen=True, tag="ray"):
    """A straight line from the vertex. ``direction`` need not have unit length."""

    direction: Triple


class Polyline(_Spec, frozen=True, tag="polyline"):
    """Straight pieces from point to point [m], shifted so that the first lies on the vertex."""

    points_m: Points


class Arc(_Spec, frozen=True, tag="arc"):
    """A level arc that leaves the vertex towards ``heading_deg``; sweep > 0 turns left."""

    radius_m: Length
    sweep_deg: Annotated[float, Meta(ge=-360, le=360)]
    heading_deg: Degrees = 0.0


class Helix(_Spec, frozen=True, tag="helix"):
    """A left-turning helix about a vertical axis; ``pitch_m`` is its signed climb per turn."""

    radius_m: Length
    pitch_m: Metres
    heading_deg: Degrees = 0.0


class Spline(_Spec, frozen=True, tag="spline"):
    """A smooth curve through points [m] (Catmull-Rom, centripetal), shifted like a polyline."""

    points_m: Points


class Curve(_Spec, frozen=True, tag="curve"):
    """Expressions in s >= 0 [m], shifted so that s = 0 lies on the vertex."""

    x: Text
    y: Text
    z: Text


ShapeSpec = Ray | Polyline | Arc | Helix | Spline | Curve


class Shape:
    """A curve by arc length; one that ends is continued straight."""

    def __init__(self, curve: ArcLengthCurve, *, endless: bool) -> None:
        self._by_length = curve
        self._endless = endless
        self._origin = curve.point(0.0)

    @property
    def end(self) -> float:
        """Arc length at which the straight continuation begins [m]; infinite without an end."""
        return inf if self._endless else self._by_length.length()

    def within(self, s: float) -> float:
        """Return an arc length [m], or the curve's end if that comes first."""
        return s if self._by_length.reaches(s) else self.end

    def point(self, s: float) -> Vector:
        """Return the point at arc length s >= 0 [m] from the vertex, relative to it [m]."""
        last = self.within(s)
        x, y, z = self._by_length.point(last)
        beyond = max(0.0, s - last)
        if beyond:
            u, v, w = self._last_direction()
            x, y, z = x + beyond * u, y + beyond * v, z + beyond * w
        return (x - self._origin[0], y - self._origin[1], z - self._origin[2])

    def check(self, s: float) -> None:
        """Raise CurveError if the curve has a pole or a jump on the way to arc length s [m]."""
        self._by_length.check(self.within(s))

    def _last_direction(self) -> Vector:
        here, before = self._by_length.point(self.end), self._by_length.point(self.end - AHEAD_M)
        return _unit(before, here)


class Straight:
    """Straight pieces; the last one continues without end, past ``end`` [m]."""

    def __init__(self, corners: list[Vector]) -> None:
        self._corners = corners
        self._starts = [0.0]
        for a, b in pairwise(corners):
            self._starts.append(self._starts[-1] + dist(a, b))
        self._units = [_unit(a, b) for a, b in pairwise(corners)]
        self.end = self._starts[-1]

    def within(self, s: float) -> float:
        """Return an arc length [m], or the last corner's if that comes first."""
        return min(s, self.end)

    def point(self, s: float) -> Vector:
        """Return the point at arc length s >= 0 [m] from the first corner, relative to it [m]."""
        piece = min(bisect_right(self._starts, s, 1) - 1, len(self._units) - 1)
        corner, unit, along = self._corners[piece], self._units[piece], s - self._starts[piece]
        origin = self._corners[0]
        return (
            corner[0] - origin[0] + along * unit[0],
            corner[1] - origin[1] + along * unit[1],
            corner[2] - origin[2] + along * unit[2],
        )

    def check(self, s: float) -> None:
        """Accept any s: straight pieces have neither poles nor jumps."""


WORK = 2_500_000
"""Most work of measuring the curves of one formation, in evaluations of a node of an expression."""
POINT_WORK = 12
"""Work for a point of a curve besides its expressions."""
FINE_M = 20.0
"""The part of a formation's curves that is measured in short pieces [m]."""
FINE_SHARE = 0.25
"""Most of the pieces that these may take."""
MIN_SAMPLES = 20


def effort_for(spec: ShapeSpec, curves: int) -> Effort:
    """Return the effort for a shape in a formation with so many measured curves."""
    texts = (spec.x, spec.y, spec.z) if isinstance(spec, Curve) else ()
    point_work = POINT_WORK + sum(map(len, texts))
    points = WORK // (point_work * max(curves, 1))
    pieces = min(points // 2, FULL_EFFORT.pieces)
    return Effort(
        fine_m=min(FINE_M / max(curves, 1), FINE_SHARE * pieces * PIECE_M),
        pieces=pieces,
        samples=min(max(points // 40, MIN_SAMPLES), FULL_EFFORT.samples),
    )


def is_measured(spec: ShapeSpec | None) -> bool:
    """Whether a shape is a curve that has to be measured."""
    return isinstance(spec, Arc | Helix | Spline | Curve)


def shape_of(spec: ShapeSpec, curves: int = 1) -> Shape | Straight:
    """Return the curve that a shape's table describes, or raise :class:`ShapeError`.

    curves: how many curves of its formation are measured.
    """
    try:
        return _shape_of(spec, effort_for(spec, curves))
    except (CurveError, ExpressionError) as error:
        raise ShapeError("", str(error)) from error


def _shape_of(spec: ShapeSpec, effort: Effort) -> Shape | Straight:
    match spec:
        case Ray():
            return _ray(spec)
        case Polyline():
            return _polyline(spec)
        case Arc():
            return _arc(spec, effort)
        case Helix():
            return _helix(spec, effort)
        case Spline():
            return _spline(spec, effort)
        case Curve():
            return _curve(spec, effort)
        case _:
            assert_never(spec)


def _ray(spec: Ray) -> Straight:
    if hypot(*spec.direction) < 1e-9:
        raise ShapeError("direction", "must not have zero length")
    return Straight([ZERO, spec.direction])


def _polyline(spec: Polyline) -> Straight:
    _check_points(spec.points_m)
    return Straight(list(spec.points_m))


def _arc(spec: Arc, effort: Effort) -> Shape:
    if spec.sweep_deg == 0.0:
        raise ShapeError("sweep_deg", "must not be 0; a straight queue is a ray")
    sweep, heading = radians(spec.sweep_deg), radians(spec.heading_deg)
    if abs(sweep) * spec.radius_m < LEAST_M:
        detail = f"the arc is {abs(sweep) * spec.radius_m:.3g} m long; at least {LEAST_M:g} m"
        raise ShapeError("sweep_deg", detail)
    side = 1.0 if sweep > 0.0 else -1.0

    def at(angle: float) -> Vector:
        radius, turned = side * spec.radius_m, heading + side * angle
        return (radius * (sin(turned) - sin(heading)), radius * (cos(heading) - cos(turned)), 0.0)

    return Shape(ArcLengthCurve(at, abs(sweep), effort), endless=False)


def _helix(spec: Helix, effort: Effort) -> Shape:
    heading = radians(spec.heading_deg)

    def at(angle: float) -> Vector:
        x = spec.radius_m * (sin(heading + angle) - sin(heading))
        y = spec.radius_m * (cos(heading) - cos(heading + angle))
        return (x, y, spec.pitch_m * angle / (2.0 * pi))

    return Shape(ArcLengthCurve(at, effort=effort), endless=True)


def _spline(spec: Spline, effort: Effort) -> Shape:
    _check_points(spec.points_m)
    last = len(spec.points_m) - 1.0
    return Shape(ArcLengthCurve(_catmull_rom(spec.points_m), last, effort), endless=False)


def _curve(spec: Curve, effort: Effort) -> Shape:
    parts = []
    for key in ("x", "y", "z"):
        try:
            parts.append(Expression(getattr(spec, key), "s"))
        except ExpressionError as error:
            raise ShapeError(key, str(error)) from error
    x, y, z = parts
    return Shape(ArcLengthCurve(lambda s: (x(s), y(s), z(s)), effort=effort), endless=True)


def _check_points(points: tuple[Vector, ...]) -> None:
    for index, (a, b) in enumerate(pairwise(points)):
        if dist(a, b) < LEAST_M:
            detail = f"points {index} and {index + 1} are {dist(a, b):.3g} m apart"
            raise ShapeError("points_m", f"{detail}; at least {LEAST_M:g} m")


def _catmull_rom(points: tuple[Vector, ...]) -> Callable[[float], Vector]:
    """Return the centripetal Catmull-Rom spline; parameter k is at point k.

    Its knots follow the square root of the distances, which keeps it free of loops. The outer
    pieces use their end point's neighbour, mirrored, as the missing point.
    """
    first = _mirrored(points[1], points[0])
    last = _mirrored(points[-2], points[-1])
    padded = (first, *points, last)

    def at(parameter: float) -> Vector:
        piece = min(int(parameter), len(points) - 2)
        p0, p1, p2, p3 = padded[piece : piece + 4]
        t0, t1 = 0.0, dist(p0, p1) ** 0.5
        t2 = t1 + dist(p1, p2) ** 0.5
        t3 = t2 + dist(p2, p3) ** 0.5
        t = t1 + (parameter - piece) * (t2 - t1)
        a1, a2, a3 = _mix(p0, p1, t0, t1, t), _mix(p1, p2, t1, t2, t), _mix(p2, p3, t2, t3, t)
        b1, b2 = _mix(a1, a2, t0, t2, t), _mix(a2, a3, t1, t3, t)
        return _mix(b1, b2, t1, t2, t)

    return at


def _mix(a: Vector, b: Vector, at_a: float, at_b: float, t: float) -> Vector:
    """Return the point at t on the line through a (at t = at_a) and b (at t = at_b)."""
    w = (t - at_a) / (at_b - at_a)
    return (a[0] + w * (b[0] - a[0]), a[1] + w * (b[1] - a[1]), a[2] + w * (b[2] - a[2]))


def _mirrored(a: Vector, about: Vector) -> Vector:
    return (2.0 * about[0] - a[0], 2.0 * about[1] - a[1], 2.0 * about[2] - a[2])


def _unit(a: Vector, b: Vector) -> Vector:
    length = dist(a, b)
    return ((b[0] - a[0]) / length, (b[1] - a[1]) / length, (b[2] - a[2]) / length)
