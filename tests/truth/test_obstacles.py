"""Distances from obstacles: against points on their surfaces, moved, turned and swept."""

from math import cos, radians, sin

import msgspec
import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from tests.truth.shapes import any_shape, surface, triples
from worldsim.scenario.obstacle_tables import Box, Cylinder, Sphere, Wall
from worldsim.truth.obstacles import Obstacles, Relative

UNIT = {
    "sphere": Sphere(centre_m=(0, 0, 0), radius_m=1.0),
    "box": Box(centre_m=(0, 0, 0), size_m=(2.0, 2.0, 2.0)),
    "cylinder": Cylinder(centre_m=(0, 0, 0), radius_m=1.0, height_m=2.0),
    "wall": Wall(from_m=(-1, 0, -1), to_m=(1, 0, -1), height_m=2.0, thickness_m=2.0),
}


def distances(shapes, points, time_s=0.0):
    return Obstacles(shapes).nearest(np.array(points, dtype=float).reshape(-1, 3), time_s)


@pytest.mark.parametrize("shape", UNIT.values(), ids=UNIT)
@pytest.mark.parametrize(
    ("point", "metres"),
    [
        ((3, 0, 0), 2.0),
        ((0, -1.5, 0), 0.5),
        ((0, 0, 4), 3.0),
        ((0, 0, 0), -1.0),
        ((0, 0, 0.5), -0.5),
    ],
)
def test_distances_along_the_axes(shape, point, metres):
    assert distances([shape], point).distance[0, 0] == pytest.approx(metres)


@example(Sphere(centre_m=(0.0, 0.0, 0.0), radius_m=1.0), (0.0, 0.0, 1.1473756936625458e-160), 0)
@given(any_shape, triples, st.integers(0, 2**32))
def test_the_distance_is_that_of_the_nearest_surface_point(shape, point, seed):
    samples = surface(shape, np.random.default_rng(seed), 300)
    found = distances([shape], point)
    distance, outward = found.distance[0, 0], found.outward[0, 0]
    to_samples = np.sqrt(((samples - point) ** 2).sum(axis=1))
    assert abs(distance) <= to_samples.min() + 1e-9
    assert np.sqrt((outward**2).sum()) == pytest.approx(1.0)
    nearest = np.array(point) - distance * outward
    assert distances([shape], nearest).distance[0, 0] == pytest.approx(0.0, abs=1e-9)


@given(any_shape, st.integers(0, 2**32))
def test_points_of_the_surface_have_distance_zero(shape, seed):
    samples = surface(shape, np.random.default_rng(seed), 40)
    assert distances([shape], samples).distance == pytest.approx(0.0, abs=1e-9)


@given(st.lists(any_shape, min_size=1, max_size=6), triples)
def test_each_column_equals_that_of_a_single_obstacle(shapes, point):
    together = distances(shapes, point)
    for column, shape in enumerate(shapes):
        alone = distances([shape], point)
        assert together.distance[0, column] == alone.distance[0, 0]
        assert together.outward[0, column].tolist() == alone.outward[0, 0].tolist()


@given(any_shape.filter(lambda shape: not isinstance(shape, Wall)), triples, triples)
def test_moved_together_nothing_changes(shape, point, shift):
    centre = tuple(a + b for a, b in zip(shape.centre_m, shift, strict=True))
    moved = msgspec.structs.replace(shape, centre_m=centre)
    there = tuple(a + b for a, b in zip(point, shift, strict=True))
    here, later = distances([shape], point), distances([moved], there)
    assert later.distance == pytest.approx(here.distance, abs=1e-9)


@given(triples, st.floats(-180.0, 180.0), st.floats(-180.0, 180.0))
def test_turned_together_nothing_changes(point, yaw_deg, turn_deg):
    c, s = cos(radians(turn_deg)), sin(radians(turn_deg))
    x, y, z = point
    box = Box(centre_m=(0, 0, 0), size_m=(3.0, 1.0, 2.0), yaw_deg=yaw_deg)
    turned = msgspec.structs.replace(box, yaw_deg=yaw_deg + turn_deg)
    there = distances([turned], (c * x - s * y, s * x + c * y, z))
    assert there.distance == pytest.approx(distances([box], point).distance, abs=1e-9)


@given(any_shape, triples, triples)
def test_the_swept_distance_is_the_least_along_the_line(shape, start, way):
    obstacles = Obstacles([shape])
    centre = obstacles.centres(0.0)
    before = np.array(start) - centre[None]
    after = before + 0.3 * np.array(way)
    ends = [Relative(each, obstacles.from_centres(each)) for each in (before, after)]
    swept = obstacles.swept(*ends)[0, 0]
    along = np.linspace(0.0, 1.0, 400)[:, None, None]
    least = obstacles.from_centres(before + along * (after - before)).distance.min()
    step = 0.3 * np.sqrt((np.array(way) ** 2).sum()) / 399
    assert least - step - 1e-9 <= swept <= least + 1e-9


def test_a_missing_vehicle_has_no_distance():
    shapes = list(UNIT.values())
    found = distances(shapes, [(np.nan, np.nan, np.nan), (2.0, 0.0, 0.0)])
    assert np.isnan(found.distance[0]).all()
    assert found.distance[1] == pytest.approx([1.0, 1.0, 1.0, 1.0])


def moving(**more):
    path = ((0.0, 0.0, 0.0), (4.0, 0.0, 0.0), (4.0, 2.0, 0.0))
    return Sphere(radius_m=0.5, **{"waypoints_m": path, "speed_mps": 0.5, **more})


@pytest.mark.parametrize(
    ("time_s", "back", "stop"),
    [(0, (0, 0), (0, 0)), (4, (2, 0), (2, 0)), (10, (4, 1), (4, 1)), (12, (4, 2), (4, 2)),
     (14, (4, 1), (4, 2)), (20, (2, 0), (4, 2)), (24, (0, 0), (4, 2)), (28, (2, 0), (4, 2))],
)  # fmt: skip
def test_a_moving_obstacle_turns_back_or_stops(time_s, back, stop):
    to_and_fro, there = moving(), moving(at_end="stop")
    centres = Obstacles([to_and_fro, there]).centres(time_s)
    assert centres[:, :2].tolist() == [pytest.approx(back), pytest.approx(stop)]


def test_a_moving_obstacle_waits_until_it_starts():
    late = Obstacles([moving(from_s=10.0)])
    assert late.centres(10.0)[0].tolist() == [0.0, 0.0, 0.0]
    assert late.centres(12.0)[0] == pytest.approx([1.0, 0.0, 0.0])


def test_a_repeated_waypoint_counts_once():
    twice = ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (1.0, 0.0, 0.0))
    assert Obstacles([moving(waypoints_m=twice)]).centres(1.0)[0] == pytest.approx([0.5, 0.0, 0.0])


@given(st.floats(0.0, 1000.0), st.sampled_from(["back", "stop"]))
def test_a_moving_obstacle_never_exceeds_its_speed(time_s, at_end):
    obstacles = Obstacles([moving(at_end=at_end)])
    way = obstacles.centres(time_s + 0.05) - obstacles.centres(time_s)
    assert np.sqrt((way**2).sum()) <= 0.5 * 0.05 + 1e-9
