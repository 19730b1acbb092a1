"""The verdict recomputed from the recording alone, and differences from a false summary."""

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from shutil import copy
from typing import Any

import msgspec
import pytest

from tests.recording.flights import record, straight_flight, wedge
from worldsim.judge.finding import InvariantTally
from worldsim.judge.verdict import Judge
from worldsim.recording.comparison import SCHEMA, UNRECORDED, Difference
from worldsim.recording.recorder import RunRecorder
from worldsim.recording.verify import Verification, compared, judged_again, verify
from worldsim.results.verdict_text import verified
from worldsim.scenario.tables import Scenario


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Judge]:
    """A recording of a run that converged, and its judge."""
    file, scenario = tmp_path_factory.mktemp("recorded") / "run.rrd", wedge(4)
    recorder = RunRecorder(file, scenario, "verified", mode="virtual")
    return file, record(recorder, scenario, list(straight_flight(scenario)))


@pytest.fixture
def judge(tmp_path: Path, recorded: tuple[Path, Judge]) -> Judge:
    """The recorded run in ``tmp_path``, without a summary."""
    file, judge = recorded
    copy(file, tmp_path)
    return judge


@pytest.fixture(scope="module")
def judged(recorded: tuple[Path, Judge]) -> Verification:
    return judged_again(recorded[0].parent, recorded[0])


@pytest.fixture
def compare(tmp_path: Path, judged: Verification) -> Callable[[], Verification]:
    """What ``verify`` does with the summary in ``tmp_path``; the recording is read once for all."""
    return lambda: compared(replace(judged, run=tmp_path), tmp_path / "summary.json")


def summary_of(judge: Judge, scenario: Scenario | None = None) -> dict[str, Any]:
    """Return a run's summary, as far as its recording shows it."""
    flown = scenario or wedge(4)
    return {
        **dict.fromkeys(UNRECORDED),
        "schema": SCHEMA,
        "outcome": "pass",
        "scenario": flown.name,
        "seed": flown.seed,
        "mode": "virtual",
        "agents": flown.fleet.agents,
        "duration_s": flown.duration_s,
        "expectations": [row.row for row in judge.expectations()],
        "coverage": [],
        "min_separation_m": judge.min_separation_m,
        "min_obstacle_distance_m": None,
        "attitude_error_deg": judge.attitude_error_deg,
        "turns_over_limit_fraction": judge.turns_over_limit_fraction,
        "invariants": msgspec.to_builtins(judge.invariants()),
        "sub_formations": [queues.row for queues in judge.sub_formations],
        "in_formation_fraction": judge.in_formation_fraction,
        "max_slot_error_m": judge.max_slot_error_m,
        "min_lambda2": judge.min_lambda2,
        "recoveries": [],
        "encounters": [],
        "faults": [],
        "packets": list(straight_flight(flown))[-1].packets,
        "phases": [
            {
                "formation": phase.formation.name,
                "from_s": phase.from_s,
                "converged": phase.converge_s is not None,
                "converge_s": phase.converge_s,
                "timed_from_s": phase.timed_from_s,
                "in_place_from_s": phase.in_place_from_s,
                "residual_m": phase.residual_m,
                "queues_converge_s": dict(zip(queues.names, queues.converge_s, strict=True)),
            }
            for phase, queues in zip(judge.phases, judge.queues, strict=True)
        ],
    }


def write_summary(
    folder: Path, judge: Judge, scenario: Scenario | None = None, **changes: object
) -> None:
    (folder / "summary.json").write_text(json.dumps({**summary_of(judge, scenario), **changes}))


def test_without_a_summary_the_recording_is_judged_but_inconclusive(
    tmp_path: Path, judge: Judge
) -> None:
    verification = verify(tmp_path)
    assert not verification.summary
    assert verification.expectations == tuple(judge.expectations())
    assert verification.min_separation_m == judge.min_separation_m
    assert verification.phases[0].converge_s == judge.phases[0].converge_s
    assert verification.whole
    assert verification.exit_status == 3
    last = verified(verification).splitlines()[-1]
    why = "no summary.json: the run has not finished, or was ended by force"
    assert last == f"inconclusive ({why})  {tmp_path}"


@pytest.mark.parametrize("reason", ["results were lost: no space", "the host was too slow"])
def test_an_inconclusive_run_stays_inconclusive(
    tmp_path: Path, judge: Judge, judged: Verification, reason: str
) -> None:
    mode = "virtual" if reason.startswith("results") else "processes"
    write_summary(tmp_path, judge, outcome="inconclusive", reason=reason, mode=mode)
    flown = replace(judged, run=tmp_path, figures=judged.figures | {"mode": mode})
    verification = compared(flown, tmp_path / "summary.json")
    assert verification.differences == ()
    assert not verification.held
    assert verification.exit_status == 3
    last = verified(verification).splitlines()[-1]
    assert last == f"inconclusive (summary.json: {reason})  {tmp_path}"


def test_a_recording_that_ends_early_is_inconclusive(tmp_path: Path) -> None:
    scenario = wedge(4)
    recorder = RunRecorder(tmp_path / "run.rrd", scenario, "cut", mode="virtual")
    judge = record(recorder, scenario, list(straight_flight(scenario))[:100])
    write_summary(tmp_path, judge)
    verification = verify(tmp_path)
    assert (verification.whole, verification.held, verification.exit_status) == (False, False, 3)
    text = verified(verification)
    assert "inconclusive (the recording ends at 4.95 s of 8 s)" in text
    assert "summary.json not compared: the recording ends at 4.95 s of 8 s; what does" in text
    false = {"seed": 42, "agents": 99, "min_separation_m": 9.0, "mode": "lockstep", "schema": 2}
    write_summary(tmp_path, judge, **false, duration_s=4.0)
    verification = compared(verification, tmp_path / "summary.json")
    assert {each.key for each in verification.differences} == {*false, "duration_s"}
    assert verification.exit_status == 3
    assert "agrees" not in verified(verification)


def test_a_true_summary_does_not_differ(tmp_path: Path, judge: Judge) -> None:
    (tmp_path / "summary.json").write_text(json.dumps(summary_of(judge)))
    verification = verify(tmp_path)
    assert verification.summary
    assert verification.differences == ()


@pytest.mark.parametrize(
    ("key", "changed"),
    [("min_separation_m", 0.9), ("turns_over_limit_fraction", 0.0), ("invariants", {})],
)
def test_a_changed_summary_differs(
    tmp_path: Path,
    judge: Judge,
    compare: Callable[[], Verification],
    key: str,
    changed: object,
) -> None:
    write_summary(tmp_path, judge, **{key: changed})
    verification = compare()
    assert {difference.key.split(".")[0] for difference in verification.differences} == {key}
    assert verification.exit_status == 3
    assert f"inconclusive (summary.json differs in {key}" in verified(verification)


def test_a_changed_figure_in_a_list_differs(
    tmp_path: Path, judge: Judge, compare: Callable[[], Verification]
) -> None:
    summary = summary_of(judge)
    residual_m = summary["phases"][0]["residual_m"]
    summary["phases"][0]["residual_m"] = residual_m + 1e-15
    (tmp_path / "summary.json").write_text(json.dumps(summary))
    assert compare().differences == (
        Difference("phases.0.residual_m", residual_m + 1e-15, residual_m),
    )


@pytest.mark.parametrize("text", ["[]", "null", "{}"])
def test_a_summary_without_figures_differs_in_all(
    tmp_path: Path, judged: Verification, compare: Callable[[], Verification], text: str
) -> None:
    (tmp_path / "summary.json").write_text(text)
    keys = {difference.key for difference in compare().differences}
    assert {"min_separation_m", "phases.0.converged", "expectations.0.held"} <= keys
    assert judged.ticks


def test_held_is_exit_0_and_a_missed_expectation_1(tmp_path: Path) -> None:
    calm = wedge(1, duration_s=6.0)
    short = wedge(1, duration_s=0.5)
    for name, scenario in (("calm", calm), ("short", short)):
        (tmp_path / name).mkdir()
        recorder = RunRecorder(tmp_path / name / "run.rrd", scenario, name, mode="virtual")
        judge = record(recorder, scenario, list(straight_flight(scenario)))
        outcome = "pass" if name == "calm" else "fail"
        write_summary(tmp_path / name, judge, scenario, outcome=outcome)
    assert verify(tmp_path / "calm").exit_status == 0
    assert verify(tmp_path / "short").exit_status == 1


def test_missing_packets_are_found_in_the_recording(tmp_path: Path) -> None:
    scenario = wedge(4)
    *ticks, last = straight_flight(scenario)
    last.packets["in_flight"] -= 1
    recorder = RunRecorder(tmp_path / "run.rrd", scenario, "leaky", mode="virtual")
    packets = last.packets
    write_summary(
        tmp_path, record(recorder, scenario, [*ticks, last]), outcome="fail", packets=packets
    )
    verification = verify(tmp_path)
    assert verification.invariants["I8"] == InvariantTally(len(ticks) + 1, 1)
    assert verification.exit_status == 1


def test_packets_are_judged_from_the_first_counters_on(tmp_path: Path) -> None:
    scenario = wedge(4)
    ticks = list(straight_flight(scenario))
    for tick in ticks[:3]:
        tick.packets.clear()
    recorder = RunRecorder(tmp_path / "run.rrd", scenario, "late", mode="lockstep")
    judge = record(recorder, scenario, ticks)
    write_summary(tmp_path, judge, mode="lockstep")
    verification = verify(tmp_path)
    assert verification.invariants["I8"] == InvariantTally(len(ticks) - 3, 0)
    assert verification.differences == ()


def test_a_missing_or_unreadable_recording_is_exit_2(tmp_path: Path) -> None:
    (tmp_path / "text.rrd").write_text("hello")
    for run in (tmp_path / "nowhere", tmp_path, tmp_path / "text.rrd"):
        verification = verify(run)
        assert verification.exit_status == 2
        assert verification.problem is not None
        assert "\n" not in verification.problem
