"""`check` warns where the safety filter cannot keep what a scenario asks of it."""

from typing import Any

import pytest

from agent.guidance.sight import braking_of, speed_cap_mps
from tests.small_scenario import SMALL
from worldsim.scenario.file import parse
from worldsim.scenario.rules import warnings_for
from worldsim.scenario.tables import Scenario

BALL = """
[[obstacle]]
shape = "sphere"
centre_m = [5, 0, 0]
radius_m = 0.5
"""
MOVING = """
[[obstacle]]
shape = "sphere"
waypoints_m = [[9, 0, 0], [5, 0, 0]]
radius_m = 0.5
speed_mps = {speed}
"""
KILL = "[[event]]\nat_s = 1.0\nkill = [1]\n"
JAM = "[[event]]\nat_s = 1.0\njam = { centre_m = [0, 0, 0], radius_m = 5 }\n"
JOIN = """
[[event]]
at_s = 1.0
join = { count = 1, start = { kind = "list", positions_m = [[3, 3, 3]] } }
"""
DENSE = '{ kind = "box", size_m = [2, 2, 1], spacing_m = 0.3 }'
DEAF_SENSOR = '[[event]]\nat_s = 2.0\nsensor = { agents = [0], mode = "silent" }\n'


def scenario(more: str = "", **keys: Any) -> Scenario:
    return parse(SMALL + more, overrides={k.replace("__", "."): v for k, v in keys.items()})


def warned(more: str = "", **keys: Any) -> list[str]:
    return [problem.key for problem in warnings_for(scenario(more, **keys))]


@pytest.mark.parametrize(
    ("more", "keys", "key"),
    [
        (KILL, {"vehicle__sensors": "[]"}, "vehicle.sensors"),
        (JAM, {"vehicle__sensors": '["laser", "sonar"]'}, "vehicle.sensors"),
        ("", {"vehicle__sensors": "[]", "netem__loss_percent": "100"}, "vehicle.sensors"),
        (BALL, {"vehicle__sensors": "[]"}, "vehicle.sensors"),
        (BALL, {"vehicle__sensors": '["sonar"]'}, "vehicle.sensors"),
        (
            BALL,
            {"vehicle__sensors": '["laser", "sonar"]', "sensor__coverage": "planar"},
            "sensor.coverage",
        ),
        (
            BALL,
            {"vehicle__sensors": '["laser", "sonar"]', "sensor__laser__elevation_deg": "20"},
            "sensor.laser.elevation_deg",
        ),
        (
            BALL,
            {"vehicle__sensors": '["laser", "sonar"]', "sensor__laser__rays": "9"},
            "sensor.laser.rays",
        ),
        (BALL, {"control__clearance_m": "2.5"}, "control.clearance_m"),
        ("", {"sensor__proximity__noise_m": "0.2"}, "sensor.proximity.noise_m"),
        (
            "",
            {"fleet__start": DENSE, "sensor__proximity__noise_m": "0.05"},
            "fleet.start",
        ),
        (
            "",
            {
                "vehicle__kind": "accelerating",
                "vehicle__max_speed_mps": "1.0",
                "vehicle__max_accel_mps2": "0.25",
            },
            "vehicle.max_speed_mps",
        ),
        (MOVING.format(speed=0.6), {}, "obstacle[0].speed_mps"),
        (MOVING.format(speed=0.3), {"control__controller": "my:Own"}, "obstacle[0]"),
        (
            MOVING.format(speed=0.3),
            {"vehicle__kind": "forward", "vehicle__max_climb_mps": "0.2"},
            "obstacle[0].speed_mps",
        ),
        (MOVING.format(speed=0.3), {"vehicle__sensors": '["laser", "sonar"]'}, "obstacle[0]"),
        (MOVING.format(speed=0.3) + KILL, {}, "obstacle[0]"),
        (MOVING.format(speed=0.3) + JOIN, {}, "obstacle[0]"),
        (MOVING.format(speed=0.3) + "from_s = 2.0\n", {}, "obstacle[0].from_s"),
        (JAM + DEAF_SENSOR, {}, "event[1].sensor"),
        ("", {"expect__min_separation_m": "0.3"}, "expect.min_separation_m"),
        (BALL, {"expect__min_obstacle_distance_m": "0.6"}, "expect.min_obstacle_distance_m"),
    ],
)
def test_a_scenario_beyond_the_filter_is_warned_of_by_key(
    more: str, keys: dict[str, Any], key: str
) -> None:
    assert key in warned(more, **keys)


@pytest.mark.parametrize(
    ("more", "keys"),
    [
        ("", {}),
        (KILL + JAM, {}),
        ("", {"vehicle__sensors": "[]", "netem__loss_percent": "50"}),
        (BALL, {"vehicle__sensors": '["laser", "sonar"]'}),
        (MOVING.format(speed=0.3), {}),
        (DEAF_SENSOR, {}),
        ("", {"sensor__proximity__noise_m": "0.02"}),
        ("", {"fleet__start": DENSE}),
        ("", {"vehicle__kind": "accelerating", "vehicle__max_accel_mps2": "1.0"}),
    ],
)
def test_a_scenario_within_the_filter_passes_without_a_warning(
    more: str, keys: dict[str, Any]
) -> None:
    assert warned(more, **keys) == []


def test_the_warning_names_the_speed_cap_that_flies() -> None:
    keys = {
        "vehicle__kind": "accelerating",
        "vehicle__max_speed_mps": "1.0",
        "vehicle__max_accel_mps2": "0.25",
    }
    flown = scenario(**keys)
    braking = braking_of(flown.vehicle, 1.0 / flown.fleet.tick_hz)
    cap = speed_cap_mps(flown.vehicle, flown.control, flown.sensor, braking)
    (problem,) = warnings_for(flown)
    assert f"caps its speed at {cap:.2g} m/s" in problem.detail
    assert 2.0 * braking.stopping_m(cap) < 2.0 - flown.control.separation_m
