"""Vehicles that only hear one another never touch, and keep what their beacons promise."""

from random import Random

import pytest

from agent.config import Vehicle
from tests.laws.blind import SLOTS, BlindFleet, Radio, scattered

SECONDS = 12
VEHICLES = {
    "kinematic": Vehicle(sensors=()),
    "forward": Vehicle(kind="forward", sensors=()),
    "accelerating": Vehicle(kind="accelerating", max_accel_mps2=0.5, sensors=()),
}
RADIOS = {
    "clear": Radio(),
    "lossy": Radio(loss=0.5, delay_s=0.2),
    "late": Radio(loss=0.1, delay_s=1.5),
    "silent for good": Radio(silent_s=(1.0, 99.0)),
    "silent from the start": Radio(silent_s=(0.0, 99.0)),
    "silent for a while": Radio(loss=0.2, silent_s=(1.0, 7.0)),
}


@pytest.mark.parametrize("kind", VEHICLES)
@pytest.mark.parametrize("radio", RADIOS)
def test_vehicles_that_only_hear_never_touch_and_keep_promises(kind, radio):
    broken = []
    for seed in range(3):
        random = Random(f"{kind} {radio} {seed}")
        starts = scattered(random, 4, 0.4, 1.5)
        dead_s = random.choice((2.0, 99.0))
        fleet = BlindFleet(random, [VEHICLES[kind]] * 4, starts, RADIOS[radio], dead_s)
        for slot in range(SECONDS * 20 * SLOTS):
            assert fleet.fly(slot) >= 0.25 - 1e-9, (seed, slot)
            broken += fleet.broken_promises(slot)
    assert not broken


@pytest.mark.parametrize("seed", (8, 9, 12, 14))
def test_vehicles_that_stay_silent_for_long_stand_and_do_not_wander_into_others(seed):
    random = Random(seed)
    starts = scattered(random, 6, 0.5, 1.5)
    fleet = BlindFleet(random, [VEHICLES["kinematic"]] * 6, starts, RADIOS["silent for good"])
    assert min(fleet.fly(slot) for slot in range(25 * 20 * SLOTS)) >= 0.25 - 1e-9
