"""Rays against distances: a ray ends on a surface, and nothing lies before that point."""

from math import cos, inf, radians, sin

import msgspec
import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from tests.truth.shapes import any_shape, coordinates, triples
from worldsim.scenario.obstacle_tables import Box, Sphere, Wall
from worldsim.truth.obstacles import Obstacles
from worldsim.truth.raycast import cast, cast_at_spheres


def unit(way):
    way = np.array(way, dtype=float)
    return way / np.sqrt((way**2).sum())


def ray(origin, way, *shapes):
    found = cast(np.array([origin], float), unit(way)[None, None], Obstacles(shapes), 0.0)
    return float(found[0, 0])


ways = triples.filter(lambda way: sum(abs(x) for x in way) > 0.1)


@given(any_shape, triples, ways)
def test_a_ray_ends_on_the_first_surface(shape, origin, way):
    obstacles, far = Obstacles([shape]), ray(origin, way, shape)
    inside = obstacles.nearest(np.array([origin], float), 0.0).distance[0, 0] < -1e-9
    assume(not inside)
    along = np.linspace(0.0, min(far, 40.0), 200)[:, None]
    distance = obstacles.nearest(np.array(origin) + along * unit(way), 0.0).distance[:, 0]
    assert distance.min() >= -1e-6
    if far < inf:
        end = (np.array(origin) + far * unit(way))[None]
        assert obstacles.nearest(end, 0.0).distance[0, 0] == pytest.approx(0.0, abs=1e-6)


@given(any_shape, triples, ways)
def test_a_ray_that_hits_nothing_stays_outside(shape, origin, way):
    if ray(origin, way, shape) == inf:
        along = np.linspace(0.0, 40.0, 400)[:, None]
        points = np.array(origin) + along * unit(way)
        assert Obstacles([shape]).nearest(points, 0.0).distance.min() >= -1e-6


@given(any_shape, triples)
def test_a_ray_from_inside_a_body_has_length_zero(shape, way):
    assume(sum(abs(x) for x in way) > 0.1)
    assert ray(Obstacles([shape]).centres(0.0)[0], way, shape) == 0.0


@given(any_shape.filter(lambda shape: not isinstance(shape, Wall)), triples, ways, triples)
def test_moved_together_nothing_changes(shape, origin, way, shift):
    moved = msgspec.structs.replace(
        shape, centre_m=tuple(a + b for a, b in zip(shape.centre_m, shift, strict=True))
    )
    there = tuple(a + b for a, b in zip(origin, shift, strict=True))
    here, later = ray(origin, way, shape), ray(there, way, moved)
    near = Obstacles([shape]).nearest(np.array([origin], float), 0.0).distance[0, 0]
    assume(abs(near) > 1e-6 and (here == inf) == (later == inf))
    assert here == later == inf or later == pytest.approx(here, abs=1e-4)


@pytest.mark.parametrize("turn_deg", range(-180, 180, 17))
def test_turned_together_nothing_changes(turn_deg):
    c, s = cos(radians(turn_deg)), sin(radians(turn_deg))
    box = Box(centre_m=(0, 0, 0), size_m=(1.0, 3.0, 2.0), yaw_deg=turn_deg)
    far = ray((-4 * c, -4 * s, 0.2), (c - 0.1 * s, s + 0.1 * c, 0.0), box)
    assert far == pytest.approx(3.5 * (1.01**0.5))


@given(st.lists(st.tuples(triples, st.floats(0.1, 2.0)), min_size=1, max_size=5), triples, ways)
def test_vehicles_are_hit_as_spheres(balls, origin, way):
    shapes = [Sphere(centre_m=centre, radius_m=radius) for centre, radius in balls]
    start = np.array(origin) - np.array([centre for centre, _ in balls])
    radius = np.array([radius for _, radius in balls])
    found = cast_at_spheres(start[None], unit(way)[None, None], radius)[0, 0]
    assert found == ray(origin, way, *shapes)


@given(coordinates)
def test_a_missing_vehicle_is_never_hit(x):
    start = np.full((1, 2, 3), np.nan)
    assert cast_at_spheres(start, unit((1, x, 0))[None, None], np.ones(2))[0, 0] == inf
