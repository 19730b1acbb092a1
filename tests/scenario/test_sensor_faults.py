"""Sensor faults of the timeline: which are valid, and how the fleet reacts."""

from pathlib import Path

import pytest

from worldsim.engine.virtual import fly
from worldsim.judge.run_events import SensorChanged
from worldsim.scenario.file import load
from worldsim.scenario.toml import ScenarioError

WEDGE = Path("deploy/scenarios/wedge-9.toml")


@pytest.mark.parametrize(
    ("fault", "key", "detail"),
    [
        ("{ agents = [0] }", "sensor.mode", "is missing"),
        ("{ mode = 'silent' }", "sensor.agents", "is missing"),
        ("{ agents = [0], mode = 'tired' }", "sensor.mode", "'stuck' or 'wrong'"),
        ("{ agents = [0], mode = 'stuck', kind = 'nose' }", "sensor.kind", "'proximity'"),
        ("{ agents = [9], mode = 'stuck' }", "sensor.agents[0]", "no agent 9; 0 to 8"),
        ("{ agents = ['vertex:X'], mode = 'stuck' }", "sensor.agents[0]", "no vertex 'X'"),
    ],
)
def test_an_invalid_sensor_fault_is_rejected(fault: str, key: str, detail: str) -> None:
    with pytest.raises(ScenarioError) as caught:
        load(WEDGE, {"event": f"[{{ at_s = 1, sensor = {fault} }}]"})
    assert str(caught.value).startswith(f"{WEDGE}: event[0].{key}: ")
    assert detail in str(caught.value)


@pytest.mark.parametrize("mode", ["stuck", "silent", "wrong"])
def test_no_vehicles_collide_and_the_fault_and_its_end_are_reported(mode: str) -> None:
    """Scanning sensors fail in the closed loop's test_moving.py."""
    event = f"[{{ at_s = 1.5, for_s = 2, sensor = {{ agents = [0], mode = '{mode}' }} }}]"
    scenario = load(WEDGE, {"event": event, "duration_s": "6"})
    loop = fly(scenario).loop
    reported = [
        (each.t_s, each.agent, each.mode) for each in loop.events if isinstance(each, SensorChanged)
    ]
    assert reported == [(1.5, 0, mode), (3.5, 0, "works again")]
    assert loop.judge.min_separation_m is not None
    assert loop.judge.min_separation_m >= 0.25
