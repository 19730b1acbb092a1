"""Whoever is in the way of what moves gives way, whatever it wants, and to others it gives none."""

from math import dist, hypot
from random import Random

import pytest

from agent.config import Vehicle
from agent.controller import Senses
from agent.guidance.evasion import retreated
from agent.guidance.safety_filter import Bound, approach_of
from tests.laws.kinds import DT, SLOTS, WISHES, Craft, anything

CLEARANCE_M = 0.5
"""Control.clearance_m as it is by default."""


def unit(random):
    return anything(random, None, 0)


class Ball:
    """A ball that aims at a vehicle where it stands at first, and flies on [m, m/s]."""

    def __init__(self, random, speed):
        self.radius = random.uniform(0.2, 0.8)
        away = unit(random)
        aside = tuple(random.uniform(-0.4, 0.4) for _ in range(3))
        self.start = tuple(4.0 * a + b for a, b in zip(away, aside, strict=True))
        self.velocity = tuple(-speed * a for a in away)

    def nearest(self, here, time_s):
        """Return the nearest point of its surface, relative [m]."""
        centre = (s + time_s * v for s, v in zip(self.start, self.velocity, strict=True))
        off = tuple(c - h for c, h in zip(centre, here, strict=True))
        share = 1.0 - self.radius / hypot(*off)
        return tuple(share * x for x in off)


def least_distance(random, speed, ticks, kind):
    """Fly one vehicle of 1 m/s, that wants the worst, in the way of a ball [m]."""
    limits = Vehicle(kind=kind, max_speed_mps=1.0, max_climb_mps=1.0)
    guard = Craft(limits, ticks).guard(1.0)
    ball, wish = Ball(random, speed), random.choice(WISHES)
    here, least, flown = (0.0, 0.0, 0.0), 9.0, (0.0, 0.0, 0.0)
    coming = [flown] * ticks
    for slot in range(round(14.0 / speed / DT)):
        point = ball.nearest(here, slot * DT)
        least = min(least, hypot(*point))
        if slot % SLOTS == 0:
            seen = (point,) if hypot(*point) < 2.0 else ()
            senses = Senses(slot * DT, here, flown, 0.0, (), (), tuple, None, obstacles=seen)
            coming.append(guard.safe(wish(random, point, slot), senses, list))
            flown = coming.pop(1)
        here = tuple(h + DT * v for h, v in zip(here, flown, strict=True))
    return least


@pytest.mark.parametrize("ticks", [1, 2])
@pytest.mark.parametrize("speed", [0.3, 0.6])
def test_a_ball_hits_nobody_whatever_they_want(speed, ticks):
    least = [least_distance(Random(seed), speed, ticks, "kinematic") for seed in range(40)]
    assert min(least) > CLEARANCE_M - 0.05
    assert min(least) < CLEARANCE_M + 0.2


def test_who_flies_only_ahead_climbs_or_sinks_out_of_the_way():
    least = [least_distance(Random(seed), 0.6, 1, "forward") for seed in range(40)]
    assert min(least) > 0.4


def test_giving_way_never_leads_into_somebody_else():
    random = Random(4)
    for _ in range(500):
        others = [Bound(unit(random), random.uniform(0.0, 0.3)) for _ in range(3)]
        comes = unit(random)
        duty = Bound(tuple(-x for x in comes), -random.uniform(0.1, 0.6), coming=comes)
        flown = retreated(unit(random), [duty, *others], 1.0, 0.5)
        assert hypot(*flown) <= 1.0 + 1e-9
        assert abs(flown[2]) <= 0.5 + 1e-9
        assert all(approach_of(flown, bound) <= bound.limit + 1e-9 for bound in others)


def test_in_the_open_it_gives_way_as_fast_as_it_must_and_goes_aside():
    duty = Bound((-1.0, 0.0, 0.0), -0.6, coming=(-0.6, 0.0, 0.0))
    flown = retreated((1.0, 0.0, 0.0), [duty], 1.0, 1.0)
    assert flown == pytest.approx((-0.6, 0.0, 0.8))


def test_beside_what_passes_it_goes_round_behind_it():
    duty = Bound((0.6, 0.8, 0.0), -0.3, coming=(0.5, 0.0, 0.0))
    flown = retreated((0.0, 0.0, 0.0), [duty], 1.0, 1.0)
    assert approach_of(flown, duty) == pytest.approx(-0.3)
    assert flown[0] < 0.0 < flown[1]
    assert dist(flown, (0.0, 0.0, 0.0)) == pytest.approx(1.0)
