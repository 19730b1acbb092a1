"""Every kind of vehicle keeps its distance from every other, and from what stands."""

from math import cos, hypot, pi, sin
from random import Random

import pytest

from agent.config import Vehicle
from agent.guidance import safety_monitor
from agent.guidance.nonholonomic import forward_limited
from agent.guidance.safety_filter import INNER_SHARE, Bound, Margins, RangingFilter, approach_of
from agent.guidance.sight import Braking
from tests.laws.kinds import Craft, anything, least_distance, straight

D_OB, CLEARANCE = 0.25, 0.5


def craft(kind, ticks=1, speed=0.5, **more):
    return Craft(Vehicle(kind=kind, max_speed_mps=speed, max_climb_mps=speed, **more), ticks)


CRAFTS = {
    "kinematic": craft("kinematic", 2),
    "forward": craft("forward", 1),
    "forward, late": craft("forward", 2, 1.0),
    "slow to brake": craft("accelerating", 1, 0.5, max_accel_mps2=1.0),
    "slow to brake, late": craft("accelerating", 2, 1.0, max_accel_mps2=2.0),
    "fast": craft("accelerating", 1, 2.0, max_accel_mps2=2.0),
}
FLEETS = [
    *[(name, name) for name in CRAFTS],
    ("kinematic", "forward, late"),
    ("kinematic", "slow to brake"),
    ("forward", "slow to brake"),
]


@pytest.mark.parametrize("names", FLEETS, ids=str)
def test_no_two_come_nearer_than_d_ob(names):
    crafts = [CRAFTS[name] for name in names]
    flown = [least_distance(Random(seed), crafts) for seed in range(120)]
    assert min(least for _, least in flown) >= D_OB - 1e-9
    assert min(least for began, least in flown if began > 0.5) < 0.45


@pytest.mark.parametrize("name", CRAFTS)
def test_nobody_comes_nearer_to_what_stands_than_its_clearance(name):
    crafts = [CRAFTS[name], CRAFTS["kinematic"]]
    flown = [least_distance(Random(seed), crafts, standing=True) for seed in range(120)]
    assert min(least for _, least in flown) >= CLEARANCE - 1e-9
    assert min(least for began, least in flown if began > 0.75) < 0.7


def test_without_reckoning_the_brakes_they_collide(monkeypatch):
    monkeypatch.setattr(safety_monitor, "braking_of", lambda _vehicle, late_s: Braking(late_s))
    crafts = [CRAFTS["fast"]] * 2
    assert min(least_distance(Random(seed), crafts)[1] for seed in range(60)) < D_OB - 0.01


def test_a_way_ahead_keeps_its_bounds_wherever_it_may_turn():
    random = Random(7)
    for _ in range(2000):
        yaw, sway = random.uniform(-pi, pi), random.uniform(0.0, 0.5)
        x, y, z = straight(random, tuple(random.gauss(0, 1) for _ in range(3)), 0)
        bound = Bound((x, y, z), random.uniform(0.0, 0.3))
        u, v, w = forward_limited(anything(random, None, 0), [bound], yaw, sway)
        forward = hypot(u, v)
        for turn in (-sway, -0.4 * sway, 0.0, 0.7 * sway, sway):
            there = (forward * cos(yaw + turn), forward * sin(yaw + turn), w)
            assert approach_of(there, bound) <= bound.limit + 1e-9


def test_a_way_ahead_beside_a_vehicle_that_noise_hides_leads_away_from_it():
    random, noise_m, flown = Random(9), 0.1, 0
    beside = RangingFilter(D_OB, 0.5, 0.1, Margins(noise_m=noise_m))
    for _ in range(4000):
        there = straight(random, tuple(random.gauss(0, 1) for _ in range(3)), 0)
        true_m = random.uniform(D_OB, D_OB + 0.6 * noise_m)
        there = tuple(true_m * each for each in there)
        error = straight(random, tuple(random.gauss(0, 1) for _ in range(3)), 0)
        error_m = random.uniform(0.0, noise_m)
        sensed = tuple(a + error_m * b for a, b in zip(there, error, strict=True))
        if hypot(*sensed) > D_OB + INNER_SHARE * noise_m:
            continue
        yaw = random.uniform(-pi, pi)
        flying = forward_limited(anything(random, None, 0), beside.bounds([sensed]), yaw, 0.1)
        approach = sum(a * b for a, b in zip(flying, there, strict=True)) / true_m
        assert approach <= 1e-9
        flown += hypot(*flying) > 0.01
    assert flown > 100


def test_a_way_ahead_is_only_shortened():
    random = Random(8)
    for _ in range(500):
        yaw = random.uniform(-pi, pi)
        wanted = anything(random, None, 0)
        u, v, w = forward_limited(wanted, [Bound((1.0, 0.0, 0.0), 0.1)], yaw, 0.2)
        assert hypot(u, v, w) <= 1.0 + 1e-9
        assert abs(cos(yaw) * v - sin(yaw) * u) <= 1e-12
        assert cos(yaw) * u + sin(yaw) * v >= 0.0
