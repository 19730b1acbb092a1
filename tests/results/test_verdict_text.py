"""The verdict in words: whole lines, as a person reads them."""

from pathlib import Path
from typing import Any

import pytest

from tests.small_scenario import SMALL
from worldsim.campaign.pool import finished
from worldsim.engine.virtual import fly
from worldsim.results.overall import Cut, FailedRun, Result, over_all
from worldsim.results.summary import Summary, summarise
from worldsim.results.verdict_text import closing_lines, table, verdict
from worldsim.scenario.file import parse

FOLDER = Path("runs/small")


@pytest.fixture(scope="module")
def summary() -> Summary:
    scenario = parse(SMALL, overrides={"expect.converge_within_s": "3"})
    return {**summarise(scenario, finished(fly(scenario), scenario)), "real_time_factor": 41.8}


def text(summary: Summary, **changes: Any) -> list[str]:
    changed: Any = {**summary, **changes}
    return verdict(changed, FOLDER, recorded=False).splitlines()


def row(
    name: str, wanted: Any, got: Any, held: bool | None, margin: float | None = None
) -> dict[str, Any]:
    return {"name": name, "wanted": wanted, "got": got, "margin": margin, "held": held}


def test_a_run_that_passes(summary: Summary) -> None:
    converge_s = summary["phases"][0]["converge_s"]
    head, separation, converged, accuracy, outcome = text(summary)
    assert head == "small, seed 1, virtual time: 2 agents, 5 s simulated at 41.8 x real time"
    assert separation == (
        "  met      minimum separation: 1.000 m (required >= 0.25 m; margin 0.750 m)"
    )
    limit = f"(limit 3 s; margin {3 - converge_s:.3g} s)"
    assert converged == f"  met      line: converged in {converge_s:.3g} s {limit}"
    assert accuracy.startswith(
        "  largest slot error at the end: < 1 mm; steps over the turn limit: "
    )
    assert outcome == "pass  runs/small/summary.json"


def test_queues_that_stood_long_before_the_whole_are_told(summary: Summary) -> None:
    row = {"formation": "vee", "from_s": 0.0, "stands_s": {"Q1": 3.0}, "lead_s": 17.54}
    told = "  vee: each queue stood in its line 17.5 s before the whole"
    assert told in text(summary, sub_formations=[row])
    for lead_s in (None, 1.2):
        assert text(summary, sub_formations=[{**row, "lead_s": lead_s}]) == text(summary)


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
            "  NOT MET  minimum obstacle distance: not measured (required >= 0.4 m)",
        ),
        (row("converge vee", 15.0, 11.8, True), "  met      vee: converged in 11.8 s (limit 15 s)"),
        (row("converge vee", None, 11.8, True), "  met      vee: converged in 11.8 s"),
        (row("converge vee", 4.0, None, False), "  NOT MET  vee did not converge within 4 s"),
        (
            row("converge vee", None, None, False),
            "  NOT MET  vee did not converge in 5 s: not every agent was in its place at the end",
        ),
        (
            row("converge vee", None, None, None),
            "  open     vee did not converge in 5 s: the run ended too early",
        ),
        (
            row("converge vee", 15.0, None, None),
            "  open     vee did not converge: the run ended after 5 s, before the limit of 15 s",
        ),
        (
            row("converge vee", 15.0, 11.8, True, 3.2),
            "  met      vee: converged in 11.8 s (limit 15 s; margin 3.2 s)",
        ),
        (
            row("in_formation_fraction", 0.95, 0.925, False, -0.025),
            "  NOT MET  time in formation: 92.5 % (required >= 95 %; margin -2.5 %)",
        ),
        (
            row("in_formation_fraction", 0.95, None, None),
            "  open     time in formation: no time counted (required >= 95 %)",
        ),
        (
            row("min_separation_m", 0.25, None, True),
            "  -        minimum separation: not measured (required >= 0.25 m)",
        ),
        (
            row("reform_within_s", 10.0, 3.25, True),
            "  met      formation restored within 3.25 s of each fault (limit 10 s)",
        ),
        (
            row("reform_within_s", 10.0, None, True),
            "  -        formation after a fault: not tested, none took it away (limit 10 s)",
        ),
        (
            row("attitude_within_deg", 5.0, 41.26, False),
            "  NOT MET  largest attitude error at the slots: 41.3 degrees (required <= 5 degrees)",
        ),
        (
            row("attitude_within_deg", 5.0, None, True),
            "  -        largest attitude error at the slots: not measured (required <= 5 degrees)",
        ),
        (
            row("in_formation_fraction", 0.95, 0.925, False),
            "  NOT MET  time in formation: 92.5 % (required >= 95 %)",
        ),
        (
            row("max_slot_error_m", 0.12, 0.034, True),
            "  met      largest slot error in formation: 0.034 m (required <= 0.12 m)",
        ),
        (
            row("max_slot_error_m", 0.12, None, False),
            "  NOT MET  largest slot error in formation: an agent had no slot (required <= 0.12 m)",
        ),
        (row("added_later", 1, 2, True), "  met      added_later: 2 (required 1)"),
    ],
)
def test_an_expectation_is_a_line_with_its_limit(
    summary: Summary, expectation: dict[str, Any], line: str
) -> None:
    assert text(summary, expectations=[expectation])[1] == line


def change(t_s: float, kind: str, agents: list[int], reformed_s: float | None) -> dict[str, Any]:
    return {
        "t_s": t_s,
        "kind": kind,
        "agents": agents,
        "reformed_s": reformed_s,
        "timed_from_s": t_s,
        "overtaken_s": None,
        "in_place_from_s": None,
        "changed": None,
        "asked_s": 5.0 - t_s if reformed_s is None else reformed_s,
    }


@pytest.mark.parametrize(
    ("recoveries", "got", "words"),
    [
        (
            [change(1.0, "kill", [7], 2.0), change(3.0, "pause", [1, 2], 6.1)],
            6.1,
            "pause of a1, a2 at 3 s: re-formed after 6.1 s (limit 3 s)",
        ),
        (
            [change(1.0, "kill", [7], None), change(1.5, "join", [9], 1.0)],
            None,
            "kill of a7 at 1 s: not re-formed within 3 s",
        ),
        (
            [change(2.5, "leave", [0, 1, 2, 3, 4], None)],
            None,
            "leave of 5 agents at 2.5 s: not re-formed: the run ended after 2.5 s,"
            " before the limit of 3 s",
        ),
        (
            [change(1.0, "kill", [7], 3.5), change(4.0, "leave", [8], None)],
            None,
            "kill of a7 at 1 s: re-formed after 3.5 s (limit 3 s)",
        ),
        (
            [
                change(1.0, "kill", [7], None) | {"overtaken_s": 2.0},
                change(2.0, "join", [], None) | {"timed_from_s": None, "asked_s": 0.0},
                change(3.0, "kill", [8], None) | {"asked_s": 1.5},
            ],
            None,
            "kill of a7 at 1 s: overtaken by the kill of a8 at 3 s after 2 s (limit 3 s)",
        ),
    ],
)
def test_the_change_that_was_restored_worst_is_named(
    summary: Summary, recoveries: list[dict[str, Any]], got: float | None, words: str
) -> None:
    open_ended = "before the limit" in words or "overtaken" in words
    expectation = row("reform_within_s", 3.0, got, None if open_ended else False)
    shown = text(summary, expectations=[expectation], recoveries=recoveries)[1]
    assert shown == f"  {'open   ' if open_ended else 'NOT MET'}  {words}"


def test_a_formation_that_was_replaced_names_the_next_mission(summary: Summary) -> None:
    first = summary["phases"][0]
    phases = [{**first, "from_s": t_s, "timed_from_s": t_s} for t_s in (0.0, 2.0)]
    rows = [row("converge a", 3.0, None, None), row("converge b", 3.0, None, False)]
    assert text(summary, expectations=rows, phases=phases)[1:3] == [
        "  open     a did not converge: the next mission came after 2 s, before the limit of 3 s",
        "  NOT MET  b did not converge within 3 s",
    ]


@pytest.mark.parametrize(
    ("wanted", "in_place_from_s", "words"),
    [
        (None, 3.5, "whole after 3.5 s, but had stood for only 1.5 s of 2 s when the run ended"),
        (
            4.0,
            3.5,
            "whole after 3.5 s, but had stood for only 1.5 s of 2 s when the run ended (limit 4 s)",
        ),
        (None, 3.01, "whole after 3.01 s, but had stood for a little less than 2 s when the run"),
    ],
)
def test_a_team_that_was_whole_when_the_run_ended_is_told_from_one_that_was_not(
    summary: Summary, wanted: float | None, in_place_from_s: float, words: str
) -> None:
    phases = [{**summary["phases"][0], "in_place_from_s": in_place_from_s}]
    line = text(summary, expectations=[row("converge a", wanted, None, None)], phases=phases)[1]
    assert line.startswith(f"  open     a: the team was {words}")


@pytest.mark.parametrize(
    ("timed_from_s", "got", "held", "words"),
    [
        (None, None, None, "a did not converge: a fault that forbids it was in force to the end"),
        (None, 1.5, True, "met      a: converged in 1.5 s though a fault forbade it (limit 3 s)"),
        (
            None,
            4.0,
            None,
            "open     a: converged in 4 s while a fault forbade it: not timed (limit",
        ),
        (2.0, 1.5, True, "a: converged in 1.5 s from 2 s on, the end of a fault that forbids it"),
        (
            4.0,
            None,
            None,
            "a did not converge: the run ended after 1 s, before the limit of 3 s from 4 s on,"
            " the end of a fault that forbids it",
        ),
    ],
)
def test_a_formation_that_a_fault_forbade_is_timed_from_its_end(
    summary: Summary, timed_from_s: float | None, got: float | None, held: bool | None, words: str
) -> None:
    phases = [{**summary["phases"][0], "timed_from_s": timed_from_s}]
    expectation = row("converge a", 3.0, got, held)
    assert words in text(summary, expectations=[expectation], phases=phases)[1]


@pytest.mark.parametrize(
    ("residual_m", "words"),
    [
        (None, "not every agent has a place"),
        (0.0002, "< 1 mm"),
        (0.02516, "25.2 mm"),
        (0.9244, "0.924 m"),
    ],
)
def test_the_slot_error_has_a_fitting_unit(
    summary: Summary, residual_m: float | None, words: str
) -> None:
    phases = [{**summary["phases"][0], "residual_m": residual_m}]
    accuracy = text(summary, phases=phases)[-2]
    assert accuracy.startswith(f"  largest slot error at the end: {words}; ")


def test_one_agent_is_not_plural(summary: Summary) -> None:
    assert ": 1 agent, 5 s simulated" in text(summary, agents=1)[0]


def test_late_frames_and_rejected_messages_are_lines_where_there_are_any(summary: Summary) -> None:
    rejected = {
        "agents": {"corrupt": 3, "replay": 9},
        "netem": {"ahead": 261, "stale": 4, "incarnation": 7},
        "world": {"arrivals": 2},
    }
    excess = {"p50": 37.5, "p99": 62.5, "max": 80.0}
    delivery = {"excess_ms": excess, "within_fraction": 0.998, "bound_ms": 62.5}
    *_, delay, refused, _ = text(summary, delivery=delivery, rejected_by_cause=rejected)
    assert delay == (
        "  extra delivery delay: median 37.5 ms, 99th percentile 62.5 ms;"
        " 99.80 % of frames within 62.5 ms (one slot and one tick)"
    )
    assert refused == (
        "  messages rejected by agents: 3 corrupt, 9 replay (older than one already used);"
        " by netem: 261 ahead (too early), 4 stale (too late),"
        " 7 with the mark of a process that does not run any more, or never did;"
        " by the world: 2 reports of delays that cannot be read"
    )


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
    assert [line.split(":")[0] for line in lines if " run passed" in line] == ["zig", "arc"]
    assert lines[-1] == "fail  many/summary.json"


def test_interrupted_runs_say_how_many_were_made(summary: Summary) -> None:
    late: Any = {**summary, "outcome": "fail", "reason": "line did not converge"}
    cut: Any = {**summary, "outcome": "inconclusive", "reason": "interrupted after 2.0 s"}
    results = [Result(Path("many/small-seed1"), summary), Result(Path("many/small-seed2"), cut)]
    results.append(Result(Path("many/small-seed3"), late))
    overall = over_all(results, Cut("interrupted", 6, 1))
    lines = table(overall, Path("many")).splitlines()
    assert "small: 1 of 3 runs passed, 1 inconclusive" in lines
    told = "interrupted: 2 of 6 runs done, 1 cut off; 1 passed, 1 failed  many/summary.json"
    assert lines[-1] == closing_lines(overall, Path("many")).splitlines()[-1] == told
    full = over_all(results[:1], Cut("no space left", 6))
    assert closing_lines(full, Path("many")) == (
        "inconclusive (no space left: 1 of 6 runs done)  many/summary.json"
    )
