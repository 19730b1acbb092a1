"""run --list and sim --list: what comes along, from wherever they are called."""

import tomllib
from pathlib import Path

import pytest

from tests.commands.conftest import Command
from worldsim.scenario.library import FOLDER, gallery
from worldsim.scenario.toml import ScenarioError


@pytest.mark.parametrize("command", ["run", "sim"])
def test_every_scenario_is_listed_with_its_line(
    tmp_path: Path, qswarm: Command, monkeypatch: pytest.MonkeyPatch, command: str
) -> None:
    monkeypatch.chdir(tmp_path)
    told = qswarm(command, "--list")
    assert (told.status, told.err) == (0, "")
    rows = [line.split("  ", 1) for line in told.out.splitlines()]
    assert [Path(file).resolve() for file, _ in rows] == sorted(FOLDER.rglob("*.toml"))
    assert all(shows.strip() for _, shows in rows)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("file", sorted(FOLDER.rglob("*.toml")), ids=lambda file: file.stem)
def test_a_scenario_says_in_one_line_what_it_shows(file: Path) -> None:
    first = file.read_text().splitlines()[0]
    assert first.startswith("# ")
    assert first.endswith(".")
    assert tomllib.loads(file.read_text())["name"] == file.stem


def test_without_a_checkout_there_is_no_gallery(tmp_path: Path) -> None:
    with pytest.raises(ScenarioError, match="no scenarios here"):
        gallery(tmp_path)
