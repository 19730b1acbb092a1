"""Shapes by arc length: a metre along a curve is a metre, whatever its parameter."""

from itertools import pairwise
from math import cos, dist, pi, sin
from time import process_time

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from agent.qstructure.curve import ArcLengthCurve, CurveError
from agent.qstructure.expression import ExpressionError
from agent.qstructure.shape import (
    Arc,
    Curve,
    Helix,
    Polyline,
    Ray,
    ShapeError,
    Spline,
    shape_of,
)

WITHIN_M = 1e-3
FINE = 2000
SHAPES = {
    "ray": Ray((-1.0, 2.0, 0.5)),
    "polyline": Polyline(((0.0, 0.0, 0.0), (1.5, 0.0, 0.0), (1.5, 1.5, 0.0), (0.0, 1.5, 1.5))),
    "arc": Arc(2.0, 200.0),
    "arc to the right": Arc(3.0, -90.0, 45.0),
    "helix": Helix(1.5, 0.8),
    "helix downwards": Helix(0.7, -2.0, 30.0),
    "spline": Spline(((1.0, 1.0, 0.0), (3.0, 1.5, 0.5), (4.0, 4.0, 1.0), (1.0, 6.0, 0.0))),
    "curve": Curve("2*cos(s)", "2*sin(s)", "0.3*s"),
    "curve that hurries": Curve("s**2", "sin(s)", "exp(s/3)"),
    "curve that starts slowly": Curve("s**3", "0", "s**2"),
    "curve with a corner": Curve("s", "abs(s-1.3)", "0"),
}


def length(shape, start, end):
    """Return the length of a part of a shape, by the sum of many short chords [m]."""
    points = [shape.point(start + (end - start) * k / FINE) for k in range(FINE + 1)]
    return sum(dist(a, b) for a, b in pairwise(points))


@pytest.mark.parametrize("spec", SHAPES.values(), ids=SHAPES)
@pytest.mark.parametrize("spacing", [0.6, 1.0])
def test_slots_are_d_ir_apart_along_the_shape(spec, spacing):
    shape = shape_of(spec)
    for rank in range(10):
        assert length(shape, rank * spacing, (rank + 1) * spacing) == pytest.approx(
            spacing, abs=WITHIN_M
        )


@pytest.mark.parametrize("spec", SHAPES.values(), ids=SHAPES)
def test_a_shape_starts_at_its_vertex_and_never_jumps(spec):
    shape = shape_of(spec)
    assert dist(shape.point(0.0), (0.0, 0.0, 0.0)) < 1e-12
    for k in range(1000):
        assert dist(shape.point(0.012 * k), shape.point(0.012 * (k + 1))) <= 0.012 + WITHIN_M


SPEEDS = {
    "half": "(s/2)",
    "tenfold": "(10*s)",
    "growing": "(s**2)",
    "slowing": "sqrt(s)",
    "uneven": "(s+0.9*sin(s))",
    "exponential": "(exp(s)-1)",
}


@pytest.mark.parametrize("parameter", SPEEDS.values(), ids=SPEEDS)
@pytest.mark.parametrize(
    ("x", "y", "z", "at"),
    [
        ("2*cos({}/2)", "2*sin({}/2)", "0", lambda s: (2 * cos(s / 2) - 2, 2 * sin(s / 2), 0.0)),
        ("0.6*{}", "-0.8*{}", "0", lambda s: (0.6 * s, -0.8 * s, 0.0)),
        (
            "0.6*cos({0})",
            "0.6*sin({0})",
            "0.8*{0}",
            lambda s: (0.6 * cos(s) - 0.6, 0.6 * sin(s), 0.8 * s),
        ),
    ],
    ids=["circle", "line", "screw"],
)
def test_the_parameters_speed_does_not_matter(parameter, x, y, z, at):
    """``at`` is the same curve at unit speed."""
    shape = shape_of(Curve(*(each.format(parameter) for each in (x, y, z))))
    for k in range(41):
        assert dist(shape.point(0.25 * k), at(0.25 * k)) < WITHIN_M


@given(
    radius=st.floats(0.3, 50.0),
    sweep=st.floats(5.0, 360.0),
    left=st.booleans(),
    heading=st.floats(-360.0, 360.0),
)
@settings(max_examples=30, deadline=None)
def test_an_arc_keeps_its_radius_and_then_continues_straight(radius, sweep, left, heading):
    side, turn = (1.0, sweep) if left else (-1.0, -sweep)
    shape = shape_of(Arc(radius, turn, heading))
    assert shape.end == pytest.approx(radius * sweep * pi / 180.0, abs=WITHIN_M * (1.0 + radius))
    towards = heading * pi / 180.0
    centre = (-side * radius * sin(towards), side * radius * cos(towards), 0.0)
    for share in (0.1, 0.5, 1.0):
        assert dist(shape.point(share * shape.end), centre) == pytest.approx(radius, abs=WITHIN_M)
    beyond = dist(shape.point(shape.end), shape.point(shape.end + 2.0))
    assert beyond == pytest.approx(2.0, abs=1e-9)


def test_a_helix_climbs_its_pitch_in_one_turn():
    turn = (4.0 * pi * pi * 1.5 * 1.5 + 0.8 * 0.8) ** 0.5
    x, y, z = shape_of(SHAPES["helix"]).point(turn)
    assert (x, y, z) == pytest.approx((0.0, 0.0, 0.8), abs=WITHIN_M)


def test_a_spline_and_a_polyline_pass_through_their_points():
    for spec in (SHAPES["spline"], SHAPES["polyline"]):
        shape, first = shape_of(spec), spec.points_m[0]
        fine = [shape.point(shape.end * k / FINE) for k in range(FINE + 1)]
        for point in spec.points_m:
            where = tuple(a - b for a, b in zip(point, first, strict=True))
            assert min(dist(where, each) for each in fine) < shape.end / FINE


REJECTED = {
    "a ray without direction": (Ray((0.0, 0.0, 0.0)), "direction"),
    "an arc without sweep": (Arc(1.0, 0.0), "sweep_deg"),
    "two points in one": (Polyline(((0.0, 0.0, 0.0), (0.0, 0.0, 0.0))), "points_m"),
    "a spline with two points in one": (
        Spline(((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (1.0, 0.0, 0.0))),
        "points_m",
    ),
    "an unknown name": (Curve("t", "0", "0"), "x"),
    "no real number at the vertex": (Curve("s", "0", "sqrt(-1-s)"), ""),
    "a pole at the vertex": (Curve("1/s", "0", "0"), ""),
}


@pytest.mark.parametrize(("spec", "key"), REJECTED.values(), ids=REJECTED)
def test_an_invalid_shape_is_rejected_by_its_key(spec, key):
    with pytest.raises(ShapeError) as rejected:
        shape_of(spec)
    assert rejected.value.key == key


WITHOUT_AN_END = {
    "a pole on the way": ("1/(2-s)", "0", "0"),
    "a jump": ("s", "floor(s/2)", "0"),
    "no length": ("1", "2", "3"),
    "a standstill": ("min(s,1.5)", "0", "0"),
    "an end that is never reached": ("tanh(s)", "0", "0"),
    "no real number on the way": ("s", "sqrt(2-s)", "0"),
}


@pytest.mark.parametrize("texts", WITHOUT_AN_END.values(), ids=WITHOUT_AN_END)
def test_a_curve_that_cannot_be_followed_is_an_error(texts):
    with pytest.raises((CurveError, ExpressionError)):
        shape_of(Curve(*texts)).check(5.0)


EXACT = {
    "a circle": (
        Curve("2*cos(s)", "2*sin(s)", "0"),
        lambda d: (2 * cos(d / 2) - 2, 2 * sin(d / 2)),
    ),
    "a large circle, quicker and quicker": (
        Curve("90*cos(s**2)", "90*sin(s**2)", "0"),
        lambda d: (90 * cos(d / 90) - 90, 90 * sin(d / 90)),
    ),
    "an arc": (Arc(1e4, 360.0, 90.0), lambda d: (1e4 * cos(d / 1e4) - 1e4, 1e4 * sin(d / 1e4))),
    "a line, slower and slower": (Curve("sqrt(s)", "0", "0"), lambda d: (d, 0.0)),
}


@pytest.mark.parametrize(("spec", "at"), EXACT.values(), ids=EXACT)
def test_arc_lengths_are_exact_to_a_millimetre_far_out(spec, at):
    shape = shape_of(spec)
    for far_m in (0.5, 19.9, 20.1, 77.7, 500.0, 1999.0):
        assert dist(shape.point(far_m), (*at(far_m), 0.0)) < WITHIN_M


def test_a_curve_is_measured_only_as_far_as_it_is_asked_for():
    evaluated = []

    def at(parameter):
        evaluated.append(parameter)
        return (parameter, 0.0, 0.0)

    curve = ArcLengthCurve(at)
    curve.point(1.0)
    assert len(evaluated) < 1000
    assert max(evaluated) < 1.1
    few = len(evaluated)
    curve.point(1000.0)
    assert len(evaluated) < few + 40_000


ENDLESS_WORK = {
    "slow": Curve("s*1e-7", "0", "0"),
    "tightly wound": Helix(0.001, 0.0),
    "very long": Curve("2*cos(s)", "2*sin(s)", "s"),
    "a long text": Curve("s+0*" + "*".join(["sin(s)"] * 40), "0", "0"),
}


@pytest.mark.parametrize("spec", ENDLESS_WORK.values(), ids=ENDLESS_WORK)
def test_measuring_comes_to_an_end(spec):
    began = process_time()
    with pytest.raises(CurveError, match="too long, too slow or too tightly wound"):
        shape_of(spec).point(1e6)
    assert process_time() - began < 3.0


@pytest.mark.parametrize(
    ("spec", "key"),
    [
        (Arc(0.001, 1e-3), "sweep_deg"),
        (Spline(((0.0, 0.0, 0.0), (0.0, 0.0, 5e-5))), "points_m"),
        (Polyline(((0.0, 0.0, 0.0), (1e-320, 0.0, 0.0))), "points_m"),
    ],
    ids=["arc", "spline", "polyline"],
)
def test_a_shape_too_small_for_a_direction_is_rejected_by_its_key(spec, key):
    with pytest.raises(ShapeError) as rejected:
        shape_of(spec)
    assert rejected.value.key == key
