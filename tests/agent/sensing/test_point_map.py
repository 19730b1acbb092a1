"""The point map: points stay for a while, and go when a ray passes through them."""

from array import array
from math import cos, hypot, pi, radians, sin

import pytest

from agent.config import SCANNERS, Sensors, Sonar
from agent.messages import NO_ECHO_MM, Scan
from agent.sensing.point_map import KEPT_S, MAX_NEAR_POINTS, PointMap
from agent.sensing.ray_pattern import pattern_of

SENSORS = Sensors(coverage="planar")
ORIGIN = (0.0, 0.0, 0.0)
AHEAD = 30
SONAR = SCANNERS.index("sonar")


def scan(**metres):
    ranges = array("H", [NO_ECHO_MM] * 61)
    for ray, far in metres.items():
        ranges[int(ray[1:])] = round(1000 * far)
    return Scan(kind=0, ranges=ranges.tobytes())


def points():
    return PointMap([pattern_of("laser", SENSORS, 20.0)])


def test_an_echo_ahead_is_a_point_ahead():
    known = points()
    known.add_scan(scan(r30=1.5), (1.0, 2.0, 3.0), pi / 2, 0.0)
    assert known.near_points((1.0, 2.0, 3.0), 0.0) == (pytest.approx((0.0, 1.5, 0.0)),)
    assert known.near_points((1.0, 3.0, 3.0), 0.0) == (pytest.approx((0.0, 0.5, 0.0)),)
    assert known.near_points((9.0, 2.0, 3.0), 0.0) == ()


def test_a_point_stays_while_the_sensor_looks_elsewhere_and_is_forgotten_in_time():
    known = points()
    known.add_scan(scan(r30=1.5), ORIGIN, 0.0, 0.0)
    known.add_scan(scan(), ORIGIN, pi, 3.0)
    assert len(known.near_points(ORIGIN, KEPT_S)) == 1
    assert known.near_points(ORIGIN, KEPT_S + 0.1) == ()


def test_a_point_that_a_ray_passes_through_is_gone():
    known = points()
    known.add_scan(scan(r30=1.5), ORIGIN, 0.0, 0.0)
    known.add_scan(scan(r30=2.5), ORIGIN, 0.0, 0.1)
    assert [round(hypot(*p), 3) for p in known.near_points(ORIGIN, 0.1)] == []
    assert len(known) == 1


def test_one_ray_without_an_echo_may_be_a_dropout_two_are_not():
    known = points()
    known.add_scan(scan(r30=1.5), ORIGIN, 0.0, 0.0)
    known.add_scan(scan(), ORIGIN, 0.0, 0.1)
    assert len(known) == 1
    known.add_scan(scan(), ORIGIN, 0.0, 0.2)
    assert len(known) == 0


def test_a_ray_beside_a_point_does_not_remove_it():
    known = points()
    known.add_scan(scan(r30=1.5), ORIGIN, 0.0, 0.0)
    for tick in range(5):
        known.add_scan(scan(r30=3.0), (0.0, 0.0, -0.2), 0.0, 0.1 * tick)
    assert any(hypot(*point) < 1.6 for point in known.near_points(ORIGIN, 0.5))


def test_a_neighbour_is_no_obstacle():
    known = points()
    known.add_scan(scan(r30=1.5), ORIGIN, 0.0, 0.0, others=[(1.6, 0.1, 0.0)])
    assert len(known) == 0


@pytest.mark.parametrize(
    ("beam_deg", "off_deg", "is_neighbour"),
    [(60.0, 28.0, True), (60.0, 40.0, True), (60.0, 60.0, False), (10.0, 28.0, False)],
)
def test_an_echo_of_a_wide_beam_is_a_neighbours_anywhere_in_the_beam(
    beam_deg: float, off_deg: float, is_neighbour: bool
) -> None:
    """The echo is 1.5 m ahead on the axis, the neighbour as far off beside it."""
    sonar = Sonar(ring=8, beam_deg=beam_deg)
    known = PointMap([pattern_of("sonar", Sensors(sonar=sonar), 20.0)])
    echoes = array("H", [NO_ECHO_MM] * 10)
    echoes[0] = 1500
    there = (1.5 * cos(radians(off_deg)), 1.5 * sin(radians(off_deg)), 0.0)
    known.add_scan(Scan(kind=SONAR, ranges=echoes.tobytes()), ORIGIN, 0.0, 0.0, others=[there])
    assert len(known) == (0 if is_neighbour else 1)


def test_a_wide_beam_shows_an_obstacle_in_front_of_a_neighbour() -> None:
    known = PointMap([pattern_of("sonar", Sensors(sonar=Sonar(ring=8, beam_deg=60.0)), 20.0)])
    echoes = array("H", [NO_ECHO_MM] * 10)
    echoes[0] = 1100
    scan = Scan(kind=SONAR, ranges=echoes.tobytes())
    known.add_scan(scan, ORIGIN, 0.0, 0.0, others=[(1.5, 0.0, 0.0)])
    assert len(known) == 1


def test_of_many_points_the_nearest_are_returned():
    known = points()
    known.add_scan(scan(**{f"r{ray}": 1.0 + 0.01 * ray for ray in range(0, 61)}), ORIGIN, 0.0, 0.0)
    near = known.near_points(ORIGIN, 0.0)
    assert len(near) <= MAX_NEAR_POINTS
    assert [hypot(*point) for point in near] == sorted(hypot(*point) for point in near)
    assert hypot(*near[0]) == pytest.approx(1.0, abs=0.05)


@pytest.mark.parametrize(("kind", "ranges"), [(0, b""), (0, b"\x01"), (0, b"\x01\x02"), (7, b"ab")])
def test_a_scan_that_does_not_fit_the_pattern_is_ignored(kind, ranges):
    known = points()
    known.add_scan(Scan(kind=kind, ranges=ranges), ORIGIN, 0.0, 0.0)
    assert len(known) == 0
