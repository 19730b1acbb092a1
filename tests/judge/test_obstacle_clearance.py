"""The least distance to resting and moving obstacles, between ticks too."""

import numpy as np
import pytest

from worldsim.judge.metrics import swept_obstacle_distance
from worldsim.scenario.obstacle_tables import Box, Sphere
from worldsim.truth.obstacles import Obstacles

BALL = Sphere(centre_m=(0, 0, 0), radius_m=0.5)
COMING = Sphere(waypoints_m=((2, 0, 0), (-2, 0, 0)), speed_mps=4.0, radius_m=0.5)


def least(before, after, *obstacles, times_s=(0.0, 1.0)):
    ends = (np.array([before], dtype=float), np.array([after], dtype=float))
    return swept_obstacle_distance(*ends, Obstacles(obstacles), times_s)


def test_passing_between_two_ticks_counts():
    assert least((-3, 1, 0), (3, 1, 0), BALL) == pytest.approx([0.5])
    assert least((-3, 0.2, 0), (3, 0.2, 0), BALL) == pytest.approx([-0.3])


def test_a_moving_obstacle_meets_a_resting_vehicle():
    assert least((0, 0.7, 0), (0, 0.7, 0), COMING) == pytest.approx([0.2])


def test_the_nearest_obstacle_counts():
    wall = Box(centre_m=(0, 3, 0), size_m=(10.0, 1.0, 2.0))
    assert least((-3, 2, 0), (3, 2, 0), BALL, wall) == pytest.approx([0.5])


def test_a_missing_vehicle_has_no_distance():
    nowhere = np.full((2, 3), np.nan)
    assert np.isnan(swept_obstacle_distance(nowhere, nowhere, Obstacles([BALL]), (0.0, 1.0))).all()
