"""A moving formation: slots are held while the frame moves, and regained behind obstacles."""

from pathlib import Path

import numpy as np
import pytest

from worldsim.engine.virtual import VirtualFleet, fly
from worldsim.scenario.file import load

DEPLOY = Path(__file__).parents[2] / "deploy" / "scenarios"
STARTS_S, TURNS_S = 10.0, 21.5
SETTLED_S = 3.0
"""Slot errors count from this time after the frame's start on [s]."""


@pytest.mark.parametrize("change", ["", "'path'"])
def test_a_moving_slot_is_held(change):
    overrides = {
        "duration_s": "40",
        "frame.waypoints_m": "[[0, 0, 0], [3, 0, 0], [3, 2, 1]]",
        "frame.speed_mps": "0.25",
        "frame.start_s": "10",
        **({"frame.yaw": change} if change else {}),
    }
    fleet, straight_m, worst_m = VirtualFleet(load(DEPLOY / "wedge-9.toml", overrides)), 0.0, 0.0
    while fleet.loop.world.time_s < 40.0:
        fleet.slot()
        time_s, error_m = fleet.loop.world.time_s, float(np.max(fleet.loop.figures.slot_error))
        if time_s > STARTS_S + SETTLED_S:
            worst_m = max(worst_m, error_m)
        if STARTS_S + SETTLED_S < time_s < TURNS_S:
            straight_m = max(straight_m, error_m)
    assert straight_m < 0.03
    assert worst_m < 0.3, "vehicles are too far behind a frame that turns"
    assert fleet.loop.judge.phases[0].residual_m < 0.01


@pytest.mark.parametrize(
    ("seed", "mode"), [(0, "constellation"), (1, "constellation"), (0, "direct"), (1, "none")]
)
def test_the_wedge_passes_a_field_of_obstacles_and_reforms(seed, mode):
    scenario = load(DEPLOY / "field-6.toml", {"seed": str(seed), "control.avoidance": mode})
    judge = fly(scenario).loop.judge
    assert [each.name for each in judge.expectations() if not each.held] == []
    assert judge.min_obstacle_distance_m > 0.5
    assert judge.min_separation_m >= 0.25
    assert judge.phases[0].residual_m < 0.1
    assert judge.turns_over_limit_fraction <= 0.05
    assert all(row.ticks and not row.violations for row in judge.invariants().values())


@pytest.mark.parametrize("mode", ["stuck", "silent", "wrong"])
@pytest.mark.parametrize("sensors", ["['proximity']", "['laser', 'sonar']"])
def test_an_agent_with_implausible_sensors_stops_and_no_vehicle_collides(sensors, mode):
    fault = f"[{{ at_s = 10, sensor = {{ agents = [0], mode = '{mode}' }} }}]"
    changes = {"event": fault, "vehicle.sensors": sensors, "duration_s": "20"}
    noise = {"sensor.proximity.noise_m": "0.02"}
    loop = fly(load(DEPLOY / "field-scan-6.toml", {**changes, **noise})).loop
    assert np.linalg.norm(loop.world.vehicles.velocity[0]) == 0.0
    assert np.all(np.linalg.norm(loop.world.vehicles.velocity[1:], axis=1) > 0.1)
    assert [e.t_s for e in loop.events if e.kind == "sensor"] == [10.0]
    assert loop.judge.invariants()["I1"].violations == 0
