"""Surface motion: an approaching surface is found from one that the vehicle flies towards."""

from math import cos, pi, sin
from random import Random

import numpy as np
import pytest

from agent.sensing.surface_motion import SurfaceMotion
from worldsim.scenario.obstacle_tables import Box, Cylinder, Sphere, Wall
from worldsim.truth.obstacles import Obstacles

DT = 0.05
STANDING = [
    Sphere(centre_m=(0.0, 0.0, 0.0), radius_m=0.5),
    Cylinder(centre_m=(0.0, 0.0, 0.0), radius_m=0.4, height_m=1.0),
    Box(centre_m=(0.0, 0.0, 0.0), size_m=(1.0, 0.6, 0.8), yaw_deg=30.0),
    Wall(from_m=(-1.0, 0.0, -0.5), to_m=(1.0, 0.0, -0.5), height_m=1.0),
]


def nearest(obstacles, here, time_s):
    distance, away = obstacles.nearest(np.array([here]), time_s)
    return [tuple(p) for p in (-distance[0, :, None] * away[0]).tolist()]


def round_about(random):
    """Return a flight round the origin [m] as a function of time [s], at less than 1 m/s."""
    radius, rise, turn = random.uniform(1.2, 1.9), random.uniform(-0.2, 0.2), random.choice((-1, 1))
    angle = random.uniform(-pi, pi)
    return lambda t: (
        radius * cos(angle + 0.4 * turn * t),
        radius * sin(angle + 0.4 * turn * t),
        rise * t,
    )


@pytest.mark.parametrize("shape", STANDING, ids=lambda each: type(each).__name__)
def test_no_surface_at_rest_approaches_in_any_flight(shape):
    obstacles = Obstacles([shape])
    for seed in range(10):
        motion, here = SurfaceMotion(0.0), round_about(Random(seed))
        for tick in range(100):
            position = here(tick * DT)
            assert motion.approaching(tick * DT, position, nearest(obstacles, position, 0.0)) == ()


def test_noise_does_not_make_a_surface_at_rest_approach():
    obstacles, random = Obstacles(STANDING[:1]), Random(3)
    motion, here, found = SurfaceMotion(0.02), round_about(random), 0
    for tick in range(400):
        position = here(tick * DT)
        read = [
            tuple(x + random.gauss(0.0, 0.02) for x in point)
            for point in nearest(obstacles, position, 0.0)
        ]
        found += motion.approaching(tick * DT, position, read) != ()
    assert found == 0


@pytest.mark.parametrize("speed", [0.3, 0.6])
def test_the_velocity_of_an_approaching_ball_is_found(speed):
    way = ((-2.5, 0.3, 0.1), (5.0, 0.3, 0.1))
    ball = Obstacles([Sphere(waypoints_m=way, speed_mps=speed, radius_m=0.4)])
    motion, found = SurfaceMotion(0.0), []
    for tick in range(round(2.0 / speed / DT)):
        point = nearest(ball, (0.0, 0.0, 0.0), tick * DT)
        found.append(motion.approaching(tick * DT, (0.0, 0.0, 0.0), point))
    assert found[0] == ()
    assert all(len(each) == 1 for each in found[1:])
    assert found[-1][0] == pytest.approx((speed, 0.0, 0.0), abs=0.35 * speed)
    assert found[-1][0][0] > 0.9 * speed


def test_a_receding_ball_is_ignored():
    way = ((-0.8, 0.0, 0.0), (-9.0, 0.0, 0.0))
    ball = Obstacles([Sphere(waypoints_m=way, speed_mps=0.5, radius_m=0.2)])
    motion = SurfaceMotion(0.0)
    for tick in range(20):
        point = nearest(ball, (0.0, 0.0, 0.0), tick * DT)
        assert motion.approaching(tick * DT, (0.0, 0.0, 0.0), point) == ()
