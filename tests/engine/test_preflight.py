"""Checks before a run starts: room for those who join, parameters, foreign agents."""

import json
import sys
from pathlib import Path
from time import process_time
from typing import Annotated

import msgspec
import pytest

from agent.parameters import made
from netem.compiled import Finder, UnloadableError
from tests.small_scenario import SMALL
from worldsim.commands.app import command
from worldsim.engine.preflight import VIRTUAL_COMMAND_TICKS, Processes, admit
from worldsim.scenario.file import dump, parse
from worldsim.scenario.tables import Scenario
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


class Tuned:
    """A controller with parameters."""

    class Parameters(msgspec.Struct, frozen=True):
        """How it flies."""

        radius_m: Annotated[float, msgspec.Meta(gt=0)]
        ways: tuple[str, ...] = ("left",)
        gain: float = 0.5

        def __post_init__(self) -> None:
            if self.gain > 9.0:
                raise ValueError("a gain over 9 shakes the vehicle")

    def __init__(self, setup: object, parameters: Parameters) -> None:
        self.parameters = parameters

    def decide(self, senses: object) -> None:
        """Decide nothing."""


class Mistaken(Tuned):
    """A controller whose parameters are no structure."""

    Parameters = list  # type: ignore[assignment]


def tuned(controller: str = "Tuned", **parameters: str) -> Scenario:
    """A scenario under a controller of this module."""
    given = {f"control.parameters.{name}": value for name, value in parameters.items()}
    return parse(SMALL, overrides={"control.controller": f"{__name__}:{controller}", **given})


def test_parameters_are_checked_and_their_defaults_filled_in() -> None:
    flown = admit(tuned(radius_m="2"), "small.toml", VIRTUAL_COMMAND_TICKS)
    assert flown.control.parameters == {"radius_m": 2.0, "ways": ["left"], "gain": 0.5}
    assert parse(dump(flown)).control.parameters == flown.control.parameters
    setup = flown.agent_setup(0, 0, VIRTUAL_COMMAND_TICKS)
    assert made(Tuned, setup, setup.control.parameters).parameters == Tuned.Parameters(2.0)


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({}, "control.parameters.radius_m: is missing; allowed: a number above 0"),
        ({"radius_m": "-1"}, "control.parameters.radius_m: got -1; allowed: a number above 0"),
        ({"radius_m": "far"}, "control.parameters.radius_m: got the text 'far'; allowed: a number"),
        (
            {"radius_m": "1", "ways": "['left', 3]"},
            "control.parameters.ways[1]: got 3; allowed: text",
        ),
        (
            {"radius_m": "1", "gian": "2"},
            "control.parameters.gian: unknown key; did you mean 'gain'? allowed: radius_m, ways",
        ),
        ({"radius_m": "1", "gain": "10"}, "control.parameters: a gain over 9 shakes the vehicle"),
    ],
)
def test_wrong_parameters_are_refused_by_name(given: dict[str, str], said: str) -> None:
    with pytest.raises(ScenarioError) as refused:
        admit(tuned(**given), "small.toml", VIRTUAL_COMMAND_TICKS)
    assert str(refused.value).startswith(f"small.toml: {said}")


@pytest.mark.parametrize(
    ("scenario", "said"),
    [
        (
            parse(SMALL, overrides={"control.parameters.gain": "1"}),
            "control.parameters: the controller 'q_structure' takes no parameters",
        ),
        (tuned("Mistaken"), "control.controller: Mistaken.Parameters is not a msgspec.Struct"),
    ],
)
def test_parameters_that_nobody_takes_are_refused(scenario: Scenario, said: str) -> None:
    with pytest.raises(ScenarioError) as refused:
        admit(scenario, "small.toml", VIRTUAL_COMMAND_TICKS)
    assert str(refused.value) == f"small.toml: {said}"


def foreign(arguments: list[str]) -> Scenario:
    """A scenario whose agent 1 is a command."""
    return parse(
        SMALL, overrides={"agent": f"[{{ ids = [1], command = {json.dumps(arguments)} }}]"}
    )


@pytest.mark.parametrize(
    ("given", "said"),
    [
        (["./none"], "agent[0].command[0]: './none' does not exist"),
        (["./plain"], "agent[0].command[0]: './plain' is not executable"),
        (["no-such-program"], "agent[0].command[0]: 'no-such-program' does not exist"),
        (["sh", "a\0b"], "agent[0].command[1]: holds a NUL"),
    ],
)
def test_a_foreign_agents_command_that_cannot_be_run_is_named(
    tmp_path: Path, given: list[str], said: str
) -> None:
    (tmp_path / "plain").write_text("")
    with pytest.raises(ScenarioError) as refused:
        admit(foreign(given), tmp_path / "s.toml", VIRTUAL_COMMAND_TICKS, "launched")
    assert f"s.toml: {said}" in str(refused.value)


def test_a_foreign_agents_program_is_found_in_the_scenarios_folder(tmp_path: Path) -> None:
    (tmp_path / "python").symlink_to(sys.executable)
    (tmp_path / "mine.py").write_text("")
    file, scenario = tmp_path / "s.toml", foreign(["./python", "mine.py", "far"])
    flown = admit(scenario, file, VIRTUAL_COMMAND_TICKS, "launched")
    # By its own name: an interpreter finds its packages by the link through which it is called.
    assert flown.commands == {1: (f"{tmp_path}/python", f"{tmp_path}/mine.py", "far")}
    assert parse(dump(flown)).commands == flown.commands


@pytest.mark.parametrize(
    ("processes", "said"), [("none", "cannot fly in virtual time"), ("by hand", "by hand, too")]
)
def test_a_foreign_agent_needs_a_launcher(processes: Processes, said: str) -> None:
    with pytest.raises(ScenarioError, match=said) as refused:
        admit(foreign([sys.executable]), "small.toml", VIRTUAL_COMMAND_TICKS, processes)
    assert refused.value.key == "agent[0].command"


def test_virtual_time_refuses_a_foreign_agent_and_check_warns_of_that(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "s.toml").write_text(dump(foreign([sys.executable])))
    said = "agent[0].command: {}a process of its own cannot fly in virtual time; use qswarm run"
    assert command(["sim", str(tmp_path / "s.toml"), "--out", str(tmp_path / "run")]) == 2
    assert said.format("") in capsys.readouterr().err
    assert not (tmp_path / "run").exists()
    assert command(["check", str(tmp_path / "s.toml")]) == 0
    assert said.format("warning: 'qswarm sim' rejects this: ") in capsys.readouterr().err


@pytest.mark.parametrize("table", ["{ ids = [1] }", "{ ids = [1], vehicle = {} }"])
def test_an_agents_table_that_changes_nothing_is_refused(table: str) -> None:
    with pytest.raises(ScenarioError, match="agent\\[0\\]: changes nothing"):
        parse(SMALL, overrides={"agent": f"[{table}]"})


def test_the_last_table_with_a_command_counts() -> None:
    tables = "[{ ids = [0, 1], command = ['a'] }, { ids = [1], command = ['b'] }]"
    scenario = parse(SMALL, overrides={"agent": tables})
    assert scenario.commands == {0: ("a",), 1: ("b",)}
