"""The virtual structure: the fit of the body, how it goes on, and what a missing member does."""

from math import cos, dist, pi, sin
from random import Random

import pytest

from agent.qstructure.target_frame import Frame
from agent.schemes.links import Situation
from agent.schemes.virtual_structure import VirtualStructure, fitted, led, links_needed
from tests.schemes.situations import WEDGE, heard, senses, setup

LAYOUT = WEDGE.layout(9)
POINTS = [LAYOUT.slots[place].point for place in LAYOUT.places]


def misfit(frame, positions):
    return sum(dist(frame.to_world(p), q) ** 2 for p, q in zip(POINTS, positions, strict=True))


def test_a_rigid_motion_is_found_again():
    random = Random(1)
    for _ in range(50):
        true = Frame(tuple(random.uniform(-9, 9) for _ in range(3)), random.uniform(-pi, pi))
        body = fitted(POINTS, [true.to_world(p) for p in POINTS], 0.0)
        assert dist(body.frame.origin, true.origin) < 1e-9
        assert (
            dist((cos(body.frame.yaw), sin(body.frame.yaw)), (cos(true.yaw), sin(true.yaw))) < 1e-9
        )
        assert body.deviation_m < 1e-9


def test_no_other_body_fits_better():
    random = Random(2)
    for _ in range(20):
        positions = [tuple(random.uniform(-3, 3) for _ in range(3)) for _ in POINTS]
        body = fitted(POINTS, positions, 0.0)
        assert misfit(body.frame, positions) == pytest.approx(9 * body.deviation_m**2)
        for _ in range(20):
            x, y, z = (a + random.gauss(0, 0.1) for a in body.frame.origin)
            other = Frame((x, y, z), body.frame.yaw + random.gauss(0, 0.1))
            assert misfit(other, positions) > misfit(body.frame, positions)


def test_members_in_one_point_have_the_yaw_of_the_frame():
    assert fitted(POINTS, [(1.0, 2.0, 3.0)] * 9, 0.7).frame.yaw == 0.7


def test_the_body_goes_on_to_its_frame_and_waits_for_who_is_off():
    away = Frame((1.0, 0.0, 0.0), 0.5)
    body = fitted(POINTS, [away.to_world(p) for p in POINTS], 0.0)
    moving = led(body, Frame(), 0.4, 2.0)
    assert moving.velocity == pytest.approx((-0.4, 0.0, 0.0))
    assert moving.yaw_rate == pytest.approx(-0.2)
    waits = led(body._replace(deviation_m=2.0), Frame(), 0.4, 2.0)
    assert waits.velocity == pytest.approx((-1.0 / 17.0, 0.0, 0.0))
    assert led(fitted(POINTS, POINTS, 0.0), Frame(), 0.4, 2.0).yaw_rate == pytest.approx(0.0)


def test_who_knows_everybody_takes_its_point():
    away = Frame((1.0, 2.0, 0.0), 0.5)
    others = [heard(k, away.to_world(POINTS[k])) for k in range(9) if k != 4]
    at = senses(away.to_world(POINTS[4]), others, frame=away)
    intent = VirtualStructure(setup(4)).decide(at)
    assert intent.place == LAYOUT.places[4]
    assert dist(intent.wanted, (0.0, 0.0, 0.0)) < 1e-9


def test_who_misses_a_member_takes_the_place_of_another():
    others = [heard(k, POINTS[k]) for k in range(9) if k not in (1, 4)]
    intent = VirtualStructure(setup(4)).decide(senses(POINTS[4], others))
    assert intent.place == WEDGE.layout(8).places[3]


def test_it_needs_all_others():
    at = Situation(5, frozenset(range(9)), frozenset({3, 4}), leader=1, vertex_agent=0)
    assert links_needed(at) == frozenset(range(9)) - {5}
