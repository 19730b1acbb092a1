"""Checks before a run starts: room for those who join, found in bounded work."""

import sys
from pathlib import Path
from time import process_time

import pytest

from netem.compiled import Finder, UnloadableError
from tests.small_scenario import SMALL
from worldsim.engine.preflight import VIRTUAL_COMMAND_TICKS, admit
from worldsim.scenario.file import parse
from worldsim.scenario.toml import ScenarioError

FULL = "{ kind = 'box', size_m = [0.1, 0.1, 0.1], spacing_m = 0.6 }"
CROWDED = "{ kind = 'box', size_m = [5, 5, 5], spacing_m = 0.6 }"


def test_a_join_that_never_has_room_is_refused_by_its_key() -> None:
    event = f"[{{ at_s = 1, join = {{ count = 3, start = {FULL} }} }}]"
    with pytest.raises(ScenarioError, match="no room for 3 agents") as refused:
        admit(parse(SMALL, overrides={"event": event}), "small.toml", VIRTUAL_COMMAND_TICKS)
    assert refused.value.key == "event[0].join.start"


def test_a_crowded_box_is_refused_in_bounded_work() -> None:
    scenario = parse(SMALL, overrides={"fleet.agents": "1000", "fleet.start": CROWDED})
    began = process_time()
    with pytest.raises(ScenarioError, match="no room for 1000 agents"):
        admit(scenario, "small.toml", VIRTUAL_COMMAND_TICKS)
    assert process_time() - began < 5.0


def test_a_timeline_that_asks_for_too_many_formations_is_refused() -> None:
    event = ", ".join(f"{{ at_s = {1 + k / 1000}, join = 1 }}" for k in range(500))
    overrides = {"event": f"[{event}]", "fleet.agents": "500", "fleet.start": "{ kind = 'box' }"}
    with pytest.raises(ScenarioError, match="500 events change what 1000 agents form"):
        parse(SMALL, overrides=overrides)


def test_a_compiled_module_that_cannot_be_loaded_is_told_of_in_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """It is not the controller's fault, and nobody can go on."""
    broken = tmp_path / "broken.so"
    broken.write_text("x = 1\n")
    monkeypatch.setattr(sys, "meta_path", [Finder({"hot_core": broken}), *sys.meta_path])
    scenario = parse(SMALL, overrides={"control.controller": "hot_core:Any"})
    with pytest.raises(UnloadableError) as ended:
        admit(scenario, "small.toml", VIRTUAL_COMMAND_TICKS)
    assert ended.value.code == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert "broken.so" in line
