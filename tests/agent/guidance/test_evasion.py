"""Evasion: a vehicle gives way to a moving obstacle, whatever it wants, and keeps other bounds."""

from math import dist, hypot
from random import Random

import pytest

from agent.config import Vehicle
from agent.controller import Senses
from agent.guidance.evasion import evasive_velocity
from agent.guidance.safety_filter import Bound, approach_of
from tests.laws.kinds import DT, SLOTS, WISHES, Craft, anything

CLEARANCE_M = 0.5
"""The default of Control.clearance_m."""


def unit(random):
    return anything(random, None, 0)


class Ball:
    """A ball that flies straight at the start position of a vehicle [m, m/s]."""

    def __init__(self, random, speed):
        self.radius = random.uniform(0.2, 0.8)
        away = unit(random)
        aside = tuple(random.uniform(-0.4, 0.4) for _ in range(3))
        self.start = tuple(4.0 * a + b for a, b in zip(away, aside, strict=True))
        self.velocity = tuple(-speed * a for a in away)

    def nearest(self, here, time_s):
        """Return the nearest point of its surface, relative to ``here`` [m]."""
        centre = (s + time_s * v for s, v in zip(self.start, self.velocity, strict=True))
        off = tuple(c - h for c, h in zip(centre, here, strict=True))
        share = 1.0 - self.radius / hypot(*off)
        return tuple(share * x for x in off)


def least_distance(random, speed, ticks, kind):
    """Fly an adversarial vehicle of 1 m/s in the way of a ball; return the least distance [m]."""
    limits = Vehicle(kind=kind, max_speed_mps=1.0, max_climb_mps=1.0)
    monitor = Craft(limits, ticks).safety_monitor(1.0)
    ball, wish = Ball(random, speed), random.choice(WISHES)
    here, least, flown = (0.0, 0.0, 0.0), 9.0, (0.0, 0.0, 0.0)
    coming = [flown] * ticks
    for slot in range(round(14.0 / speed / DT)):
        point = ball.nearest(here, slot * DT)
        least = min(least, hypot(*point))
        if slot % SLOTS == 0:
            seen = (point,) if hypot(*point) < 2.0 else ()
            senses = Senses(
                now_s=slot * DT,
                position=here,
                velocity=flown,
                yaw=0.0,
                vehicles=(),
                neighbours=(),
                team=tuple,
                mission=None,
                obstacles=seen,
            )
            coming.append(monitor.safe_velocity(wish(random, point, slot), senses))
            flown = coming.pop(1)
        here = tuple(h + DT * v for h, v in zip(here, flown, strict=True))
    return least


@pytest.mark.parametrize("ticks", [1, 2])
@pytest.mark.parametrize("speed", [0.3, 0.6])
def test_a_ball_hits_no_vehicle_whatever_it_wants(speed, ticks):
    least = [least_distance(Random(seed), speed, ticks, "kinematic") for seed in range(40)]
    assert min(least) > CLEARANCE_M - 0.05
    assert min(least) < CLEARANCE_M + 0.2


def test_a_forward_vehicle_climbs_or_sinks_out_of_the_way():
    least = [least_distance(Random(seed), 0.6, 1, "forward") for seed in range(40)]
    assert min(least) > 0.4


def test_giving_way_never_leads_into_another_vehicle():
    random = Random(4)
    for _ in range(500):
        others = [Bound(unit(random), random.uniform(0.0, 0.3)) for _ in range(3)]
        approach = unit(random)
        retreat = Bound(
            tuple(-x for x in approach), -random.uniform(0.1, 0.6), surface_velocity=approach
        )
        flown = evasive_velocity(unit(random), [retreat, *others], 1.0, 0.5)
        assert hypot(*flown) <= 1.0 + 1e-9
        assert abs(flown[2]) <= 0.5 + 1e-9
        assert all(approach_of(flown, bound) <= bound.limit + 1e-9 for bound in others)


def test_in_the_open_it_retreats_as_fast_as_it_must_and_goes_aside():
    retreat = Bound((-1.0, 0.0, 0.0), -0.6, surface_velocity=(-0.6, 0.0, 0.0))
    flown = evasive_velocity((1.0, 0.0, 0.0), [retreat], 1.0, 1.0)
    assert flown == pytest.approx((-0.6, 0.0, 0.8))


def test_beside_a_passing_surface_it_goes_round_behind_it():
    retreat = Bound((0.6, 0.8, 0.0), -0.3, surface_velocity=(0.5, 0.0, 0.0))
    flown = evasive_velocity((0.0, 0.0, 0.0), [retreat], 1.0, 1.0)
    assert approach_of(flown, retreat) == pytest.approx(-0.3)
    assert flown[0] < 0.0 < flown[1]
    assert dist(flown, (0.0, 0.0, 0.0)) == pytest.approx(1.0)


def test_a_retreat_from_a_surface_at_rest_approaches_no_other_one():
    random = Random(11)
    for _ in range(300):
        bounds = [
            Bound(unit(random), limit)
            for limit in (-random.uniform(0.1, 1.5), -random.uniform(0.0, 0.3), 0.2)
        ]
        wanted = tuple(random.uniform(-0.5, 0.5) for _ in range(3))
        flown = evasive_velocity(wanted, bounds, 0.5, 0.5)
        assert all(approach_of(flown, each) <= max(0.0, each.limit) + 1e-9 for each in bounds)
