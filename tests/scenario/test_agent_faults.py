"""Faults of single agents in the timeline: which are valid."""

from pathlib import Path

import pytest

from worldsim.scenario.file import load
from worldsim.scenario.safety_checks import poses_right_without_a_sensor
from worldsim.scenario.toml import ScenarioError

WEDGE = Path("deploy/scenarios/wedge-9.toml")


@pytest.mark.parametrize(
    ("fault", "key", "detail"),
    [
        ("clock = { offset_s = 1 }", "clock.agents", "is missing"),
        ("clock = { agents = [9], offset_s = 1 }", "clock.agents[0]", "no agent 9; 0 to 8"),
        ("clock = { agents = [1] }", "clock.offset_s", "the clock would be right"),
        ("clock = { agents = [1], offset_s = -2 }", "clock.offset_s", "less than 0 s"),
        ("clock = { agents = [1], offset_s = 1e9 }", "clock.offset_s", "86400"),
        ("clock = { agents = [1], drift_ppm = 1e6 }", "clock.drift_ppm", "10000"),
        ("pose = { bias_m = [1, 0, 0] }", "pose.agents", "is missing"),
        ("pose = { agents = [1] }", "pose.bias_m", "the pose would be right"),
        ("pose = { agents = [1], bias_m = [1, 0] }", "pose.bias_m", "3"),
        ("pose = { agents = [1], noise_m = -1 }", "pose.noise_m", "0"),
        ("slow = { agents = [1] }", "slow.delay_s", "is missing"),
        ("slow = { agents = [1], delay_s = 0 }", "slow.delay_s", "0.001"),
        ("slow = { agents = [1], delay_s = 11 }", "slow.delay_s", "10"),
        ("starve = { agents = [1] }", "starve.cpu_percent", "is missing"),
        ("starve = { agents = [1], cpu_percent = 100 }", "starve.cpu_percent", "99"),
        ("starve = { agents = [1], cpu_percent = 9, period_s = 0 }", "starve.period_s", "0.05"),
        (
            "starve = { agents = [1], cpu_percent = 9 }",
            "starve.period_s",
            "0.5; 9 % of it is 45 ms, less than a tick of 50 ms: steps may never take place; 0.56",
        ),
        ("intruder = { agents = [0, 1, 2, 3, 4, 5, 6, 7, 8] }", "intruder.agents", "at most 8"),
        ("pose = { agents = ['queue:X'], noise_m = 1 }", "pose.agents[0]", "no queue 'X'"),
    ],
)
def test_an_invalid_fault_is_rejected(fault: str, key: str, detail: str) -> None:
    with pytest.raises(ScenarioError) as caught:
        load(WEDGE, {"event": f"[{{ at_s = 1, {fault} }}]"})
    assert str(caught.value).startswith(f"{WEDGE}: event[0].{key}: ")
    assert detail in str(caught.value)


def clock(at_s: float, offset_s: float, agents: str = "[1]", more: str = "") -> str:
    return f"{{ at_s = {at_s}, clock = {{ agents = {agents}, offset_s = {offset_s} }}{more} }}"


@pytest.mark.parametrize(
    ("first", "second", "refused"),
    [
        (clock(5, -3), clock(6, -4), True),
        (clock(5, -3), clock(6, -4, "[2]"), False),
        (clock(5, -3), clock(6, -4, "['all']"), True),
        (clock(5, -3), clock(6, -4, "['random:1']"), True),
        (clock(5, -3, more=", for_s = 1"), clock(6, -4), False),
        (clock(5, -3, more=", for_s = 2"), clock(6, -4), True),
        (clock(5, -3), clock(8, -4), False),
        (clock(2, 9, more=", for_s = 5"), clock(5, -4), False),
        (clock(2, 9), clock(5, -4.5), False),
        (clock(5, -3), clock(6, -3), False),
    ],
)
def test_clock_faults_together_show_no_time_below_0(first: str, second: str, refused: bool) -> None:
    if not refused:
        assert load(WEDGE, {"event": f"[{first}, {second}]"}).event
        return
    with pytest.raises(ScenarioError, match=r"event\[1\].clock.offset_s: -4; .* less than 0 s"):
        load(WEDGE, {"event": f"[{first}, {second}]"})


def test_a_clock_fault_again_and_again_shows_no_time_below_0() -> None:
    with pytest.raises(ScenarioError, match="of agent 1 could show less than 0 s at 7 s"):
        load(WEDGE, {"event": f"[{clock(5, -3, more=', every_s = 1')}]"})


@pytest.mark.parametrize(("sensors", "warned"), [("['proximity']", False), ("[]", True)])
def test_a_wrong_pose_among_vehicles_that_cannot_sense_each_other_is_warned_of(
    sensors: str, warned: bool
) -> None:
    event = "[{ at_s = 1, pose = { agents = [1], noise_m = 1 } }]"
    scenario = load(WEDGE, {"event": event, "vehicle.sensors": sensors})
    problem = poses_right_without_a_sensor(scenario)
    assert (problem is not None and problem.key == "event[0].pose") == warned
