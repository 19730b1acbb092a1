"""Obstacles of any kind and size, and points on their surfaces."""

from math import atan2, cos, hypot, pi, radians, sin

import numpy as np
from hypothesis import strategies as st

from worldsim.scenario.obstacle_tables import Box, Cylinder, Sphere, Wall

sizes = st.floats(0.1, 3.0)
coordinates = st.floats(-5.0, 5.0)
triples = st.tuples(coordinates, coordinates, coordinates)
angles = st.floats(-180.0, 180.0)
spheres = st.builds(lambda c, r: Sphere(centre_m=c, radius_m=r), triples, sizes)
cylinders = st.builds(
    lambda c, r, h: Cylinder(centre_m=c, radius_m=r, height_m=h), triples, sizes, sizes
)
boxes = st.builds(
    lambda c, s, yaw: Box(centre_m=c, size_m=s, yaw_deg=yaw),
    triples,
    st.tuples(sizes, sizes, sizes),
    angles,
)


@st.composite
def walls(draw):
    x, y, z = draw(triples)
    length, yaw = draw(sizes), radians(draw(angles))
    to = (x + length * cos(yaw), y + length * sin(yaw), z)
    return Wall(from_m=(x, y, z), to_m=to, height_m=draw(sizes), thickness_m=draw(sizes))


any_shape = spheres | cylinders | boxes | walls()


def surface(shape, random, count):
    """Return random points (count, 3) on a shape's surface [m; world frame]."""
    if isinstance(shape, Sphere):
        points = random.standard_normal((count, 3))
        points *= shape.radius_m / np.sqrt((points**2).sum(axis=1))[:, None]
        return points + shape.centre_m
    if isinstance(shape, Cylinder):
        return _cylinder(shape, random, count) + shape.centre_m
    size, yaw, centre = _as_box(shape)
    points = random.uniform(-0.5, 0.5, (count, 3))
    axis = random.integers(3, size=count)
    points[np.arange(count), axis] = random.choice((-0.5, 0.5), count)
    points *= size
    turn = np.array([[cos(yaw), sin(yaw), 0.0], [-sin(yaw), cos(yaw), 0.0], [0.0, 0.0, 1.0]])
    return points @ turn + centre


def _cylinder(shape, random, count):
    azimuth = random.uniform(-pi, pi, count)
    on_side = random.random(count) < 0.5
    r = shape.radius_m * np.where(on_side, 1.0, np.sqrt(random.random(count)))
    caps = random.choice((-0.5, 0.5), count)
    z = shape.height_m * np.where(on_side, random.uniform(-0.5, 0.5, count), caps)
    return np.stack((r * np.cos(azimuth), r * np.sin(azimuth), z), axis=1)


def _as_box(shape):
    if isinstance(shape, Box):
        return np.array(shape.size_m), radians(shape.yaw_deg), np.array(shape.centre_m)
    (x, y, z), (u, v, _) = shape.from_m, shape.to_m
    size = np.array([hypot(u - x, v - y), shape.thickness_m, shape.height_m])
    return size, atan2(v - y, u - x), np.array([(x + u) / 2, (y + v) / 2, z + shape.height_m / 2])
