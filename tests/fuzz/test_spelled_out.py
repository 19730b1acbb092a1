"""A start that is written out is the one that was drawn, and agents can be left out of it."""

import msgspec
import numpy as np

from tests.small_scenario import SMALL
from worldsim.fuzz.spelled_out import with_listed_start, with_named_agents
from worldsim.scenario.file import as_toml, parse
from worldsim.truth.obstacles import Obstacles
from worldsim.truth.start_positions import start_poses_of


def test_a_start_written_out_is_the_one_that_was_drawn() -> None:
    drawn = {"fleet.agents": "6", "fleet.start": "{ kind = 'box', size_m = [4, 4, 1] }"}
    scenario = parse(SMALL, overrides=drawn)
    tables = with_listed_start(msgspec.to_builtins(scenario), scenario)
    written = parse(as_toml(tables))
    for before, after in zip(poses(scenario), poses(written), strict=True):
        assert np.abs(before - after).max() < 2e-3
    assert with_listed_start(tables, written) is tables


def test_faults_name_those_that_they_struck() -> None:
    events = [
        {"at_s": 1.0, "pause": ["random:2"], "for_s": 1.0},
        {"at_s": 2.0, "kill": ["netem"], "for_s": 1.0},
        {"at_s": 3.0, "sensor": {"agents": ["all"], "mode": "silent"}},
    ]
    rows = [
        {"t_s": 1.0, "kind": "pause", "agent": 4, "number": 0},
        {"t_s": 1.0, "kind": "pause", "agent": 1, "number": 0},
        {"t_s": 2.0, "kind": "resume", "agent": 4, "number": 0},
        {"t_s": 2.0, "kind": "netem_outage", "agent": None, "number": 1},
        {"t_s": 3.0, "kind": "sensor", "agent": 0, "number": 2},
        {"t_s": 3.1, "kind": "slot", "agent": 3},
    ]
    named = with_named_agents({"event": events}, rows)["event"]
    assert named[0] == events[0] | {"pause": [1, 4]}
    assert named[1] == events[1]
    assert named[2]["sensor"] == {"agents": [0], "mode": "silent"}


def poses(scenario):
    return start_poses_of(scenario, Obstacles(scenario.obstacle))
