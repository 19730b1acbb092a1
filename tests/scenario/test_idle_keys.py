"""Keys without an effect are warned of by name."""

import pytest

from tests.small_scenario import SMALL
from worldsim.scenario.file import parse
from worldsim.scenario.rules import warnings_for

IDLE = {
    "netem.reorder_percent": {"netem.reorder_percent": "50"},
    "netem.distribution": {"netem.distribution": "normal", "netem.delay_ms": "20"},
    "netem.delay_correlation_percent": {
        "netem.delay_correlation_percent": "25",
        "netem.delay_ms": "20",
    },
    "netem.rate_overhead_b": {"netem.rate_overhead_b": "40"},
    "netem.limit": {"netem.limit": "2", "netem.delay_ms": "500"},
    "netem.multihop.limit": {"netem.multihop.limit": "2", "netem.local.rate_kbit": "99"},
    "netem.link[0].limit": {"netem.link": "[{ from = 0, to = 1, limit = 3 }]"},
    "event[0].netem.limit": {"event": "[{ at_s = 1, netem = { limit = 3 } }]"},
    "netem.multihop": {"netem.multihop.loss_percent": "9", "comms.multihop_hz": "0"},
    "sensor.laser": {"sensor.laser.noise_m": "0.1"},
    "sensor.laser.elevation_deg": {
        "vehicle.sensors": "['laser']",
        "sensor.laser.rings": "1",
        "sensor.laser.elevation_deg": "9",
    },
    "event[0].sensor.kind": {
        "event": "[{ at_s = 1, sensor = { agents = [0], mode = 'stuck', kind = 'sonar' } }]"
    },
    "event[0].sabotage.per_s": {
        "event": "[{ at_s = 1, sabotage = { kind = 'replay', agents = [0], per_s = 9 } }]"
    },
    "event[0].sabotage.delay_s": {
        "event": "[{ at_s = 1, sabotage = { kind = 'spoof', agents = [0], delay_s = 9 } }]"
    },
    "vehicle.max_accel_mps2": {"vehicle.max_accel_mps2": "3"},
    "vehicle.max_turn_deg": {
        "vehicle.max_turn_deg": "30",
        "vehicle.max_turn_left_deg": "30",
        "vehicle.max_turn_right_deg": "30",
    },
    "control.cast_far_m": {"control.controller": "flocking", "control.cast_far_m": "0.4"},
    "frame.turn_dps": {"frame.turn_dps": "20"},
    "obstacle[0].from_s": {
        "obstacle": "[{ shape = 'sphere', centre_m = [9, 9, 9], radius_m = 1, from_s = 2 }]"
    },
    "expect.converge_within_s": {"expect.converge": "false", "expect.converge_within_s": "2"},
    "expect.attitude_within_deg": {"expect.attitude_within_deg": "5"},
    "event[0].at_s": {"event": "[{ at_s = 4.99, kill = [0] }]"},
    "event[1].at_s": {"event": "[{ at_s = 1, kill = ['world'] }, { at_s = 2, kill = [0] }]"},
    "event[0].every_s": {"event": "[{ at_s = 1, kill = [0], every_s = 3.99 }]"},
    "expect.min_obstacle_distance_m": {"expect.min_obstacle_distance_m": "0.5"},
}
USED = {
    "an event in the last slot": {"event": "[{ at_s = 4.9875, kill = [0] }]"},
    "an event that happens twice": {"event": "[{ at_s = 1, kill = [0], every_s = 3.9875 }]"},
    "reorder with a delay": {"netem.reorder_percent": "50", "netem.delay_ms": "20"},
    "reorder with a later delay": {
        "netem.reorder_percent": "50",
        "event": "[{ at_s = 1, netem = { delay_ms = 20 } }]",
    },
    "limit with the rate of a channel": {
        "netem.limit": "2",
        "netem.local.rate_kbit": "99",
    },
    "an accelerating vehicle": {
        "vehicle.max_accel_mps2": "3",
        "agent": "[{ ids = [1], vehicle = { kind = 'accelerating' } }]",
    },
    "a laser on one vehicle": {
        "sensor.laser.noise_m": "0.1",
        "agent": "[{ ids = [1], vehicle = { sensors = ['laser'] } }]",
    },
    "a frame that turns later": {
        "frame.turn_dps": "20",
        "event": "[{ at_s = 1, frame = { yaw = 'path', waypoints_m = [[0, 0, 0], [9, 0, 0]],"
        " speed_mps = 0.1 } }]",
    },
}


def idle(overrides: dict[str, str]) -> list[str]:
    found = warnings_for(parse(SMALL, overrides=overrides))
    return [problem.key for problem in found if problem.detail.startswith("no effect: ")]


@pytest.mark.parametrize(("key", "overrides"), IDLE.items(), ids=IDLE)
def test_a_key_without_an_effect_is_named(key: str, overrides: dict[str, str]) -> None:
    assert idle(overrides) == [key]


@pytest.mark.parametrize("overrides", USED.values(), ids=USED)
def test_a_key_with_an_effect_is_not(overrides: dict[str, str]) -> None:
    assert idle(overrides) == []


def test_defaults_are_not_named() -> None:
    assert idle({}) == []
