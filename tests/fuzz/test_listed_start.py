"""A start that is written out is the one that was drawn, and agents can be left out of it."""

import msgspec
import numpy as np

from tests.small_scenario import SMALL
from worldsim.fuzz.listed_start import with_listed_start
from worldsim.scenario.file import as_toml, parse
from worldsim.truth.obstacles import Obstacles
from worldsim.truth.start_positions import start_poses_of


def test_a_start_written_out_is_the_one_that_was_drawn() -> None:
    drawn = {"fleet.agents": "6", "fleet.start": "{ kind = 'box', size_m = [4, 4, 1] }"}
    scenario = parse(SMALL, overrides=drawn)
    tables = with_listed_start(msgspec.to_builtins(scenario), scenario)
    assert tables is not None
    written = parse(as_toml(tables))
    for before, after in zip(poses(scenario), poses(written), strict=True):
        assert np.abs(before - after).max() < 2e-3
    assert with_listed_start(tables, written) is None


def poses(scenario):
    return start_poses_of(scenario, Obstacles(scenario.obstacle))
