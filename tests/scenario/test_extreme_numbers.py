"""Extreme numbers: refused by key within bounded time, or flown without an exception."""

import random
from time import process_time

import pytest

from tests.scenario.extreme_numbers import base, checked, extreme, fly


@pytest.mark.parametrize("seed", range(3))
def test_the_base_scenarios_are_sound(seed: int) -> None:
    assert checked(base(random.Random(seed))) is not None


@pytest.mark.parametrize("first", range(0, 120, 40))
def test_what_check_accepts_flies(first: int) -> None:
    flown = 0
    for seed in range(first, first + 40):
        began = process_time()
        scenario = checked(extreme(random.Random(seed)))
        assert process_time() - began < 3.0, seed
        if scenario is not None:
            flown += 1
            fly(scenario)
    assert flown
