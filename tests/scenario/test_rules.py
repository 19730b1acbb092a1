"""Warnings, and scenarios that no clock or only one of them accepts."""

from pathlib import Path

import pytest

from worldsim.engine.preflight import admit
from worldsim.scenario.file import load
from worldsim.scenario.rules import speed_problem, warnings_for
from worldsim.scenario.tables import Scenario
from worldsim.scenario.toml import ScenarioError

WEDGE = Path("deploy/scenarios/wedge-9.toml")


def wedge(**overrides: str) -> Scenario:
    return load(WEDGE, {key.replace("__", "."): value for key, value in overrides.items()})


def test_the_wedge_has_no_warnings() -> None:
    assert warnings_for(wedge()) == []


def test_the_warning_of_a_cast_zone_beyond_lemma_7_names_the_bound() -> None:
    assert not warnings_for(wedge(netem__range_m="3", control__cast_far_m="0.5"))
    (warning,) = warnings_for(wedge(netem__range_m="2", control__cast_far_m="0.5"))
    assert warning.key == "control.cast_far_m"
    assert "at most 0.25 " in warning.detail


def test_neighbours_beyond_range_are_a_warning() -> None:
    (warning,) = warnings_for(wedge(netem__local__range_m="0.9"))
    assert warning.key == "netem.range_m"


def test_a_run_too_short_to_see_convergence_is_a_warning() -> None:
    assert not warnings_for(wedge(duration_s="14"))
    (warning,) = warnings_for(wedge(duration_s="13.9"))
    assert warning.key == "expect.converge_within_s"


def test_a_mission_that_nobody_knows_and_no_event_gives_is_a_warning() -> None:
    (warning,) = warnings_for(wedge(fleet__briefed="[]"))
    assert warning.key == "fleet.briefed"
    for change in ("formation = '../formations/helix.toml'", "frame = { yaw_deg = 90 }"):
        assert not warnings_for(wedge(fleet__briefed="[]", event=f"[{{ at_s = 1, {change} }}]"))
    assert not warnings_for(wedge(fleet__briefed="[8]"))


@pytest.mark.parametrize(
    "keys",
    [
        {"fleet__briefed": "[0]"},
        {"event": "[{ at_s = 1, join = 1 }]"},
        {"event": "[{ at_s = 1, kill = [0] }, { at_s = 2, restart = [0] }]"},
        {"event": "[{ at_s = 1, leave = [0], for_s = 1 }]"},
    ],
)
def test_a_mission_that_cannot_spread_to_who_needs_it_is_a_warning(keys: dict[str, str]) -> None:
    assert not warnings_for(wedge(**keys))
    (warning,) = warnings_for(wedge(comms__multihop_hz="0", **keys))
    assert warning.key == "comms.multihop_hz"
    assert not warnings_for(
        wedge(
            comms__multihop_hz="0",
            expect="{ converge = false, min_separation_m = 0.25 }",
            **keys,
        )
    )


def test_a_team_that_is_briefed_and_stays_needs_no_channel_for_missions() -> None:
    keys = {"comms__multihop_hz": "0", "event": "[{ at_s = 1, kill = [0] }]"}
    assert not warnings_for(wedge(control__allocation="assignment", **keys))
    assert not warnings_for(wedge(control__controller="flocking", **keys))


def test_leaders_without_their_channel_are_a_warning() -> None:
    (warning,) = warnings_for(wedge(comms__multihop_hz="0"))
    assert warning.key == "comms.multihop_hz"
    assert "nobody but a leader takes a place" in warning.detail


@pytest.mark.parametrize(
    ("speed", "ticks", "tick_hz"),
    [("0.5", 1, None), ("1", 2, None), ("1.01", 2, 21), ("2", 1, None), ("2", 2, 40)],
)
def test_the_problem_of_fast_vehicles_names_a_tick_rate_that_solves_it(
    speed: str, ticks: int, tick_hz: int | None
) -> None:
    found = speed_problem(wedge(vehicle__max_speed_mps=speed), ticks)
    if tick_hz is None:
        assert found is None
        return
    assert found is not None
    assert f"fleet.tick_hz = {tick_hz} is enough" in found.detail
    faster = wedge(vehicle__max_speed_mps=speed, fleet__tick_hz=str(tick_hz))
    assert speed_problem(faster, ticks) is None


def refusal(tmp_path: Path, scenario: Scenario) -> str:
    with pytest.raises(ScenarioError) as caught:
        admit(scenario, tmp_path / "s.toml", 1)
    return str(caught.value).removeprefix(str(tmp_path))


@pytest.mark.parametrize(
    "name", ["q_structur", "no.such:Thing", "json:Nothing", "json:loads", ":", "a b:c", "."]
)
def test_a_controller_that_is_not_found(tmp_path: Path, name: str) -> None:
    error = refusal(tmp_path, wedge(control__controller=f"'{name}'"))
    assert error.startswith("/s.toml: control.controller: ")
    assert "\n" not in error


def test_a_controller_that_breaks_while_imported(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "broken_controller.py").write_text("class :\n")
    monkeypatch.syspath_prepend(str(tmp_path))
    error = refusal(tmp_path, wedge(control__controller="broken_controller:Mine"))
    assert "cannot be imported: SyntaxError" in error


@pytest.mark.parametrize("agents", ["9", "1000"])
def test_a_box_without_room_is_refused_quickly(tmp_path: Path, agents: str) -> None:
    scenario = wedge(fleet__agents=agents, fleet__start__size_m="[0.5, 0.5, 0.5]")
    assert refusal(tmp_path, scenario).startswith("/s.toml: fleet.start: no room for ")


def test_no_network_is_connected_more_than_by_all() -> None:
    joined = {"event": "[{ at_s = 1, join = 1 }]"}
    assert wedge(expect__min_lambda2="9").expect.min_lambda2 == 9.0
    assert wedge(expect__min_lambda2="10", **joined).expect.min_lambda2 == 10.0
    with pytest.raises(ScenarioError, match=r"expect.min_lambda2: 9.1; at most 9, the number of"):
        wedge(expect__min_lambda2="9.1")


def test_a_laser_has_no_more_rays_than_a_scan_holds() -> None:
    many = {"sensor__laser__rays": "600", "sensor__laser__elevation_deg": "80"}
    assert wedge(**many, sensor__laser__rings="50").sensor.laser.rays == 600
    with pytest.raises(ScenarioError, match=r"sensor\.laser\.rays: 600 in each of 51 rings"):
        wedge(**many, sensor__laser__rings="51")
    assert wedge(**many, sensor__laser__rings="51", sensor__coverage="'planar'")


def test_a_level_laser_has_one_ring() -> None:
    with pytest.raises(ScenarioError, match=r"sensor\.laser\.rings: 9 rings need elevation_deg"):
        wedge(sensor__laser__rings="9", sensor__laser__elevation_deg="0")
    assert wedge(sensor__laser__rings="9").sensor.laser.rings == 9


@pytest.mark.parametrize(
    ("keys", "why"),
    [
        ({"control__allocation": "assignment"}, "control.allocation = 'structure', which is"),
        ({"control__controller": "flocking"}, "control.controller = 'q_structure', which is"),
    ],
)
def test_only_queues_with_leaders_gather(keys: dict[str, str], why: str) -> None:
    assert wedge(control__gather="true").control.gather
    with pytest.raises(ScenarioError) as refused:
        wedge(control__gather="true", **keys)
    assert refused.value.key == "control.gather"
    assert why in str(refused.value)
