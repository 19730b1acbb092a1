"""JUnit files: what passes, fails and is left open, as a CI reads it."""

from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

import pytest

from tests.small_scenario import SMALL
from worldsim.campaign.pool import finished
from worldsim.engine.virtual import fly
from worldsim.results.junit import check_junit_file, write_junit
from worldsim.results.overall import FailedRun, Made, Result
from worldsim.results.run_folder import RunDirectoryError
from worldsim.results.summary import Summary, summarise
from worldsim.scenario.file import parse

FOLDER = Path("many/small-seed1")
MISSED = {"name": "converge line", "wanted": 1.0, "got": 1.25, "margin": -0.25, "held": False}
OPEN = {"name": "converge line", "wanted": 9.0, "got": None, "margin": None, "held": None}
UNTESTED = {"name": "reform_within_s", "wanted": 3.0, "got": None, "margin": None, "held": True}
VIOLATED = {"I4": {"ticks": 400, "violations": 12}}


@pytest.fixture(scope="module")
def summary() -> Summary:
    scenario = parse(SMALL)
    return summarise(scenario, finished(fly(scenario), scenario))


def run(summary: Summary, **changes: Any) -> Result:
    changed: Any = {**summary, **changes}
    return Result(FOLDER, changed)


def written(folder: Path, *runs: Made, cut_off_by: str | None = None) -> ET.Element:
    write_junit(folder / "made.xml", runs, cut_off_by)
    return ET.parse(folder / "made.xml").getroot()


def findings(root: ET.Element) -> dict[str | None, tuple[str, str | None]]:
    """Return the element and its message of each case that did not pass."""
    return {
        case.get("name"): (found.tag, found.get("message"))
        for case in root.iter("testcase")
        for found in case
        if found.tag != "system-out"
    }


def counts(element: ET.Element) -> list[str | None]:
    return [element.get(name) for name in ("tests", "failures", "errors", "skipped")]


def test_each_expectation_and_invariant_of_a_run_that_passes_is_a_case(
    summary: Summary, tmp_path: Path
) -> None:
    root = written(tmp_path, run(summary), run(summary, seed=2))
    (suite,) = root
    per_run = 1 + len(summary["expectations"]) + len(summary["invariants"])
    assert suite.get("name") == "small"
    assert counts(root) == counts(suite) == [str(2 * per_run), "0", "0", "0"]
    names = [(case.get("classname"), case.get("name")) for case in suite]
    assert len(set(names)) == len(names)
    assert names[:3] == [
        ("small.1", "outcome"),
        ("small.1", "min_separation_m"),
        ("small.1", "converge line"),
    ]
    assert {name for name, _ in names} == {"small.1", "small.2"}
    assert ("small.2", "invariant I1") in names
    told = suite.findtext("testcase/system-out")
    assert told == f"run: {FOLDER}\ntrace_sha256: {summary['trace_sha256']}"


def test_a_failure_tells_what_was_required_got_and_the_margin(
    summary: Summary, tmp_path: Path
) -> None:
    failed = run(summary, outcome="fail", reason="two", expectations=[MISSED], invariants=VIOLATED)
    root = written(tmp_path, failed)
    assert findings(root) == {
        "outcome": ("failure", "two"),
        "converge line": ("failure", "line: converged in 1.25 s (limit 1 s; margin -0.25 s)"),
        "invariant I4": ("failure", "two agents kept claiming one slot (I4), in 12 of 400 ticks"),
    }
    assert root.findtext(".//failure[@type='not met']") == "required: 1\ngot: 1.25\nmargin: -0.25"
    assert counts(root) == ["3", "3", "0", "0"]


def test_an_inconclusive_run_is_an_error_and_fails_no_case(
    summary: Summary, tmp_path: Path
) -> None:
    rows = [MISSED, {**OPEN, "name": "converge vee"}, UNTESTED]
    invariants = {**VIOLATED, "I8": {"ticks": 0, "violations": 0}}
    doubtful = run(
        summary,
        outcome="inconclusive",
        reason="slow",
        expectations=rows,
        invariants=invariants,
        phases=[*summary["phases"], *summary["phases"]],
    )
    root = written(tmp_path, doubtful)
    found = findings(root)
    assert found.pop("outcome") == ("error", "slow")
    assert {tag for tag, _ in found.values()} == {"skipped"}
    reasons = {name: (message or "").split(":")[0] for name, (_, message) in found.items()}
    assert reasons == {
        "converge line": "not met, but the run is inconclusive",
        "converge vee": "not judged",
        "reform_within_s": "not tested",
        "invariant I4": "violated, but the run is inconclusive",
        "invariant I8": "never evaluated",
    }
    assert counts(root) == ["6", "0", "1", "5"]


def test_a_formation_that_was_asked_for_twice_has_two_cases(
    summary: Summary, tmp_path: Path
) -> None:
    twice = run(summary, expectations=[MISSED, OPEN], phases=[*summary["phases"]] * 2)
    names = [case.get("name") for case in written(tmp_path, twice).iter("testcase")]
    assert names[1:3] == ["converge line", "converge line (2)"]


def test_a_run_without_a_summary_and_runs_not_made_are_errors(
    summary: Summary, tmp_path: Path
) -> None:
    lost = FailedRun(Path("many/arc-seed4"), "arc", 4, "lost \x1b\ufffe", "Traceback\n<&>")
    root = written(tmp_path, lost, run(summary), cut_off_by="interrupted: 2 of 6 runs done")
    assert [suite.get("name") for suite in root] == ["arc", "small", "all runs"]
    errors = [(each.get("message"), each.text) for each in root.iter("error")]
    assert errors == [
        ("lost \\x1b\\ufffe", "Traceback\n<&>"),
        ("interrupted: 2 of 6 runs done", None),
    ]
    assert counts(root)[2] == "2"


def test_a_file_is_checked_without_a_trace(tmp_path: Path) -> None:
    check_junit_file(tmp_path / "new.xml")
    check_junit_file(tmp_path / "made" / "later.xml", tmp_path / "made")
    assert list(tmp_path.iterdir()) == []
    (tmp_path / "old.xml").write_text("<testsuites/>")
    check_junit_file(tmp_path / "old.xml")
    assert (tmp_path / "old.xml").read_text() == "<testsuites/>"


@pytest.mark.parametrize("name", [".", "none/made.xml", "scenario.toml", "scenario.toml/made.xml"])
def test_a_file_that_cannot_be_written_or_is_something_else_is_refused(
    tmp_path: Path, name: str
) -> None:
    (tmp_path / "scenario.toml").write_text('name = "mine"')
    for refuse in (check_junit_file, lambda file: write_junit(file, [])):
        with pytest.raises(RunDirectoryError):
            refuse(tmp_path / name)
    assert (tmp_path / "scenario.toml").read_text() == 'name = "mine"'


def test_nothing_passes_in_a_run_that_ended_before_it_flew(tmp_path: Path) -> None:
    scenario = parse(SMALL)
    flight = fly(scenario, should_stop=lambda: True)
    summary = summarise(scenario, finished(flight, scenario))
    assert (summary["duration_s"], summary["trace_sha256"]) == (0.0, None)
    root = written(tmp_path, run(summary))
    found = findings(root)
    assert found.pop("outcome") == ("error", "interrupted after 0.0 s")
    assert {tag for tag, _ in found.values()} == {"skipped"}
    tests, *_ = counts(root)
    assert tests == str(1 + len(found))
