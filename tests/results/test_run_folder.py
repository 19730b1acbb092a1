"""A run's folder: created once, completely or not at all; a full disk is reported."""

import json
from datetime import datetime
from pathlib import Path

import pytest

from tests.small_scenario import SMALL
from worldsim.results.run_folder import RunDirectory, RunDirectoryError, RunWriteError
from worldsim.scenario.file import parse
from worldsim.scenario.tables import Scenario

FULL = Path("/dev/full")


@pytest.fixture
def scenario(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Scenario:
    monkeypatch.chdir(tmp_path)
    return parse(SMALL)


def test_it_holds_the_resolved_scenario_and_a_folder_for_logs(scenario: Scenario) -> None:
    directory = RunDirectory.create(Path("a/b"), scenario)
    assert parse((directory.path / "scenario.toml").read_text()) == scenario
    assert directory.logs.is_dir()
    assert directory.recording == Path("a/b/run.rrd")


def test_an_existing_empty_folder_is_not_used_either(scenario: Scenario) -> None:
    Path("there").mkdir()
    with pytest.raises(RunDirectoryError, match="there: exists; a run is never overwritten"):
        RunDirectory.create(Path("there"), scenario)
    assert list(Path("there").iterdir()) == []


def test_the_default_name_has_the_time_in_utc(scenario: Scenario) -> None:
    name = RunDirectory.create(None, scenario).path.name.removeprefix("small-")
    assert datetime.strptime(name, "%Y%m%dT%H%M%S%z").utcoffset() is not None


def test_an_event_can_be_read_as_soon_as_it_is_written(scenario: Scenario) -> None:
    directory = RunDirectory.create(Path("a"), scenario)
    events = [{"t_s": 0.5 * k, "kind": "slot", "agent": None} for k in range(3)]
    for count, event in enumerate(events, 1):
        directory.event(event)
        lines = Path("a/events.jsonl").read_text().splitlines()
        assert [json.loads(line) for line in lines] == events[:count]


def test_a_full_disk_is_reported_once_and_events_go_on(
    scenario: Scenario, capsys: pytest.CaptureFixture[str]
) -> None:
    directory = RunDirectory.create(Path("a"), scenario)
    Path("a/events.jsonl").unlink()
    Path("a/events.jsonl").symlink_to(FULL)
    for _ in range(3):
        directory.event({"t_s": 0.0, "kind": "slot", "agent": 0})
    assert capsys.readouterr().err == "a/events.jsonl: no space left on device; events are lost\n"


def test_a_summary_that_cannot_be_written_is_an_error(scenario: Scenario) -> None:
    directory = RunDirectory.create(Path("a"), scenario)
    Path("a/summary.part").symlink_to(FULL)
    with pytest.raises(RunWriteError, match=r"a/summary\.json: no space left on device"):
        directory.write_summary({"outcome": "pass"})
    assert not Path("a/summary.json").exists()


def test_a_summary_is_strict_json(scenario: Scenario) -> None:
    directory = RunDirectory.create(Path("a"), scenario)
    with pytest.raises(ValueError, match="not JSON compliant"):
        directory.write_summary({"outcome": float("nan")})
    assert not Path("a/summary.json").exists()


def test_a_run_that_never_started_keeps_scenario_and_logs_alone(scenario: Scenario) -> None:
    directory = RunDirectory.create(Path("a"), scenario)
    directory.write_summary({"outcome": "pass"})
    directory.recording.write_bytes(b"rrd")
    directory.remove_results()
    assert sorted(path.name for path in Path("a").iterdir()) == ["logs", "scenario.toml"]
