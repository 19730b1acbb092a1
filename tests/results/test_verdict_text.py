"""The verdict in words: whole lines, as a person reads them."""

from pathlib import Path
from typing import Any

import pytest

from tests.small_scenario import SMALL
from worldsim.campaign.pool import finished
from worldsim.engine.virtual import fly
from worldsim.results.overall import FailedRun, Result, over_all
from worldsim.results.summary import Summary, summarise
from worldsim.results.verdict_text import table, verdict
from worldsim.scenario.file import parse

FOLDER = Path("runs/small")


@pytest.fixture(scope="module")
def summary() -> Summary:
    scenario = parse(SMALL, overrides={"expect.converge_within_s": "3"})
    return {**summarise(scenario, finished(fly(scenario), scenario)), "real_time_factor": 41.8}


def text(summary: Summary, **changes: Any) -> list[str]:
    changed: Any = {**summary, **changes}
    return verdict(changed, FOLDER, recorded=False).splitlines()


def row(name: str, wanted: Any, got: Any, held: bool) -> dict[str, Any]:
    return {"name": name, "wanted": wanted, "got": got, "held": held}


def test_a_run_that_passes(summary: Summary) -> None:
    converge_s = summary["phases"][0]["converge_s"]
    head, separation, converged, accuracy, outcome = text(summary)
    assert head == "small, seed 1, virtual time: 2 agents, 5 s simulated at 41.8 x real time"
    assert separation == "  met      minimum separation: 1.000 m (required >= 0.25 m)"
    assert converged == f"  met      line: converged in {converge_s:.3g} s (limit 3 s)"
    assert accuracy.startswith("  largest slot error at the end: 0.")
    assert outcome == "pass  runs/small/summary.json"


def test_the_viewer_is_named_where_there_is_a_recording(summary: Summary) -> None:
    *_, outcome, hint = verdict(summary, FOLDER, recorded=True).splitlines()
    assert (outcome, hint) == ("pass  runs/small/run.rrd", "view it: qswarm view runs/small")


@pytest.mark.parametrize(
    ("expectation", "line"),
    [
        (
            row("min_separation_m", 0.25, 0.1, False),
            "  NOT MET  minimum separation: 0.100 m (required >= 0.25 m)",
        ),
        (
            row("min_obstacle_distance_m", 0.4, None, False),
            "  NOT MET  minimum obstacle distance: - (required >= 0.4 m)",
        ),
        (row("converge vee", 15.0, 11.8, True), "  met      vee: converged in 11.8 s (limit 15 s)"),
        (row("converge vee", None, 11.8, True), "  met      vee: converged in 11.8 s"),
        (row("converge vee", 15.0, None, False), "  NOT MET  vee: did not converge (limit 15 s)"),
        (
            row("reform_within_s", 10.0, 3.25, True),
            "  met      formation restored within 3.25 s of each team change (limit 10 s)",
        ),
        (
            row("reform_within_s", 10.0, None, False),
            "  NOT MET  formation not restored after a team change (limit 10 s)",
        ),
        (row("reform_within_s", 10.0, None, True), "  met      no team change (limit 10 s)"),
        (row("added_later", 1, 2, True), "  met      added_later: 2 (required 1)"),
    ],
)
def test_an_expectation_is_a_line_with_its_limit(
    summary: Summary, expectation: dict[str, Any], line: str
) -> None:
    assert text(summary, expectations=[expectation])[1] == line


def test_late_frames_and_rejected_messages_are_lines_where_there_are_any(summary: Summary) -> None:
    rejected = {"agents": {"corrupt": 3}, "netem": {"ahead": 261, "stale": 4}, "world": {}}
    excess = {"p50": 37.5, "p99": 62.5, "max": 80.0}
    delivery = {"excess_ms": excess, "within_fraction": 0.998, "bound_ms": 62.5}
    *_, delay, refused, _ = text(summary, delivery=delivery, rejected_by_cause=rejected)
    assert delay == (
        "  extra delivery delay: median 37.5 ms, 99th percentile 62.5 ms;"
        " 99.80 % of frames within 62.5 ms (one slot and one tick)"
    )
    assert refused == "  rejected messages: 3 corrupt (by agents); 261 early, 4 late (by netem)"


def test_an_outcome_has_its_reason(summary: Summary) -> None:
    changed = text(summary, outcome="inconclusive", reason="interrupted after 2.0 s")
    assert changed[-1] == "inconclusive (interrupted after 2.0 s)  runs/small/summary.json"


def test_many_runs_are_a_table_with_spreads(summary: Summary) -> None:
    results = [Result(Path(f"many/small-seed{k}"), {**summary, "seed": k}) for k in (1, 2)]
    lines = table(over_all(results), Path("many")).splitlines()
    assert lines[0].split("  ")[0] == "run"
    assert [line.split()[0] for line in lines[1:3]] == ["small-seed1", "small-seed2"]
    assert {len(line) for line in lines[1:3]} == {len(lines[1])}
    assert lines[4] == "small: 2 of 2 runs passed"
    assert lines[5] == "  separation    min 1.000 m, median 1.000 m, max 1.000 m (2 runs)"
    assert lines[-1] == "pass  many/summary.json"


def test_scenarios_stand_in_the_order_given_and_a_controller_error_is_a_row(
    summary: Summary,
) -> None:
    error = "controller 'x:Y' of agent 0 failed at 1 s: ValueError: lost"
    results = [
        Result(Path("many/zig-seed1"), {**summary, "scenario": "zig"}),
        FailedRun(Path("many/arc-seed4"), "arc", 4, error),
    ]
    overall = over_all(results)
    assert [row["seed"] for row in overall["rows"]] == [1, 4]
    lines = table(overall, Path("many")).splitlines()
    assert [line.split()[0] for line in lines[1:3]] == ["zig-seed1", "arc-seed4"]
    assert lines[2].endswith(f"  fail ({error})")
    assert [line.split(":")[0] for line in lines if "runs passed" in line] == ["zig", "arc"]
    assert lines[-1] == "fail  many/summary.json"


def test_interrupted_runs_say_how_many_were_made(summary: Summary) -> None:
    cut: Any = {**summary, "outcome": "inconclusive", "reason": "interrupted after 2.0 s"}
    results = [Result(Path("many/small-seed1"), summary), Result(Path("many/small-seed2"), cut)]
    lines = table(over_all(results, interrupted_of=6), Path("many")).splitlines()
    assert "small: 1 of 2 runs passed, 1 inconclusive" in lines
    assert lines[-1] == "inconclusive (interrupted: 2 of 6 runs made)  many/summary.json"
