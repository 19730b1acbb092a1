"""The library from the command line: --list, and scenarios by name from any folder."""

import re
import tomllib
from pathlib import Path

import pytest

from agent.qstructure.formation import FormationSpec
from tests.commands.conftest import Command
from worldsim.scenario.file import parse
from worldsim.scenario.library import FORMATIONS, SCENARIOS, find_formation, find_scenario
from worldsim.scenario.library import scenarios as library
from worldsim.scenario.toml import ScenarioError

FILES = sorted(SCENARIOS.rglob("*.toml"))


@pytest.fixture(autouse=True)
def elsewhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.parametrize("command", ["run", "sim"])
def test_list_prints_each_name_and_what_the_scenario_shows(
    elsewhere: Path, qswarm: Command, command: str
) -> None:
    printed = qswarm(command, "--list")
    assert (printed.status, printed.err) == (0, "")
    rows = [line.split("  ", 1) for line in printed.out.splitlines()]
    names = [name.strip() for name, _ in rows]
    assert sorted(names) == sorted(file.stem for file in FILES)
    wedges = [name for name in names if re.fullmatch(r"wedge-\d+", name)]
    assert wedges == ["wedge-9", "wedge-20", "wedge-50", "wedge-100"]
    assert all(shows.strip() for _, shows in rows)
    assert list(elsewhere.iterdir()) == []


@pytest.mark.parametrize("file", FILES, ids=lambda file: file.stem)
def test_a_scenario_begins_with_one_line_on_what_it_shows(file: Path) -> None:
    first = file.read_text().splitlines()[0]
    assert first.startswith("# ")
    assert first.endswith(".")
    assert tomllib.loads(file.read_text())["name"] == file.stem


def test_every_listed_scenario_is_found_by_its_name(qswarm: Command) -> None:
    for entry in library():
        printed = qswarm("check", entry.name)
        assert (printed.status, printed.err) == (0, ""), entry.name
        assert parse(printed.out).name == entry.name


def test_commands_take_a_name(qswarm: Command) -> None:
    short = ("--duration", "0.5", "--no-recording")
    assert "wedge-9, seed 1, virtual time" in qswarm("sim", "wedge-9", *short).out
    two = qswarm("sim", "wedge-9", "head-on-1", "--out", "two", *short)
    assert {path.name for path in Path("two").iterdir()} >= {"wedge-9-seed1", "head-on-1-seed1"}
    assert [line.split(": warning: ")[0] for line in two.err.splitlines()] == [
        "wedge-9: expect.converge_within_s",
        "head-on-1: expect.converge_within_s",
    ]
    printed = qswarm("netem", "check", "wedge-9", "--plot", "radio.png")
    assert (printed.status, printed.out.splitlines()[-1]) == (
        0,
        "ok: all within tolerance; drawn in radio.png",
    )


def test_a_file_wins_over_a_name_but_a_folder_does_not(elsewhere: Path) -> None:
    (elsewhere / "wedge-9").mkdir()
    assert find_scenario("wedge-9").resolve() == SCENARIOS / "wedge-9.toml"
    (elsewhere / "wedge-20").write_text("mine")
    assert find_scenario("wedge-20").resolve() == elsewhere / "wedge-20"


def test_formations_are_found_by_name_too(elsewhere: Path) -> None:
    for file in FORMATIONS.rglob("*.toml"):
        assert find_formation(file.stem).resolve() == file
    with pytest.raises(ScenarioError, match=r"no such formation .* closest: pyramidal-wedge"):
        find_formation("pyramidal-wegde")
    (elsewhere / "helix.toml").write_text("mine")
    assert find_formation("helix.toml") == Path("helix.toml")


def test_a_scenario_names_a_formation_of_the_library_or_a_file(elsewhere: Path) -> None:
    event = "[[event]]\nat_s = 5\nformation = 'three-horizontal-lines'\n"
    text = f"fleet = {{ agents = 9 }}\n[formation]\nfile = 'pyramidal-wedge'\n{event}"
    scenario = parse(text)
    assert scenario.formation.name == "pyramidal-wedge"
    assert isinstance(scenario.event[0].formation, FormationSpec)
    assert scenario.event[0].formation.name == "three-horizontal-lines"
    own = (FORMATIONS / "helix.toml").read_text().replace('name = "helix"', 'name = "own"')
    (elsewhere / "pyramidal-wedge").write_text(own)
    assert parse(text, elsewhere / "mine.toml").formation.name == "own"


def test_a_formation_that_does_not_exist_is_one_error_with_the_closest_names() -> None:
    with pytest.raises(ScenarioError) as caught:
        parse("fleet = { agents = 9 }\nformation = { file = 'helx' }\n")
    assert str(caught.value).startswith(
        "scenario.toml: formation.file: no such file: helx, and no such formation in the library;"
        " closest: helix; they are in "
    )


def test_names_that_are_not_similar_are_not_suggested(qswarm: Command) -> None:
    printed = qswarm("sim", "nosuch")
    assert printed.err == (
        "nosuch: no such file, and no such scenario in the library; qswarm run --list shows all\n"
    )


def test_an_installation_without_scenarios_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(ScenarioError, match="scenarios are missing"):
        library(tmp_path)
