"""The verdict recomputed from a recording alone, and compared with the run's summary.

A new judge sees the recorded ticks. They are the rows that the run's judge saw, so its figures are
equal, not merely close: any difference means that summary and recording do not belong together, and
then neither proves anything.
"""

import json
from collections.abc import Iterator
from dataclasses import asdict, dataclass, field, replace
from math import isfinite
from pathlib import Path
from textwrap import shorten
from typing import Any

import msgspec

from worldsim.judge.fault_spans import FaultSpans
from worldsim.judge.finding import Expectation, InvariantTally
from worldsim.judge.recovery import Recovery
from worldsim.judge.run_events import WorldStopped
from worldsim.judge.verdict import Judge
from worldsim.recording.comparison import (
    REPEATABLE,
    Difference,
    Shown,
    contradictions,
    differences,
    differences_in_part,
    value_at,
)
from worldsim.recording.isolated_reader import read_run_apart
from worldsim.recording.layout import RECORDING_FILE, SUMMARY_FILE
from worldsim.recording.readback import DamagedError, Readback, RecordingError
from worldsim.recording.rejudged import in_order, rejudge
from worldsim.recording.run_files import file_differences

Figure = float | None
HELD, NOT_HELD, UNREADABLE, INCONCLUSIVE = 0, 1, 2, 3
TIME_SLACK_S = 1e-9
MAX_NAMED = 4
"""Of more differences, the first are named."""
MAX_REASON = 300
"""Length of the reason for which a recording cannot be read [characters]."""


@dataclass(frozen=True, slots=True)
class PhaseFigures:
    """How the team came into one formation, under the keys of summary.json."""

    formation: str
    from_s: float
    converged: bool
    converge_s: Figure
    timed_from_s: Figure
    in_place_from_s: Figure
    residual_m: Figure
    queues_converge_s: dict[str, Figure]


@dataclass(frozen=True, slots=True)
class Verification:
    """What a recording shows, and where the run's summary differs."""

    run: Path
    problem: str | None = None
    """Why nothing could be judged, in one line; None where the recording was judged."""
    damaged: bool = False
    """Whether there is a recording, but it cannot be read."""
    finished: bool = True
    """Whether the recording was written to its end."""
    exact: bool = True
    """Whether the recording holds the positions that were judged; an older one has them rounded."""
    scenario: str | None = None
    ticks: int = 0
    until_s: float = 0.0
    """Time of the last recorded tick [s]."""
    duration_s: float = 0.0
    """Duration of the run as the scenario asks for it [s]."""
    tick_s: float = 0.0
    """Time between two ticks [s]."""
    expectations: tuple[Expectation, ...] = ()
    min_separation_m: Figure = None
    min_obstacle_distance_m: Figure = None
    turns_over_limit_fraction: Figure = None
    phases: tuple[PhaseFigures, ...] = ()
    recoveries: tuple[Recovery, ...] = ()
    invariants: dict[str, InvariantTally] = field(default_factory=dict)
    passes: bool = False
    """Whether nothing that the recording shows speaks against the run."""
    outcome: str = "fail"
    """That of the recorded ticks: "pass", "fail", or "inconclusive" where they are too few."""
    idle_faults: bool = False
    """Whether the scenario allows faults that strike nothing."""
    ended_s: Figure = None
    """When the scenario killed the world, and so ended the run early [s]."""
    figures: dict[str, Any] = field(default_factory=dict)
    """Everything that was recomputed, under the keys of summary.json."""
    summary: bool = False
    """Whether there is a summary to compare with."""
    doubt: str | None = None
    """Why the recording proves nothing, from its summary; None: the summary gives no reason."""
    uncompared: str | None = None
    """Why only figures were compared that do not depend on the run's length; None: all were."""
    differences: tuple[Difference, ...] = ()
    contradictions: tuple[str, ...] = ()
    """Where the summary contradicts itself, in words."""
    file_differences: tuple[Difference, ...] = ()
    """Where scenario.toml or events.jsonl differs."""

    @property
    def whole(self) -> bool:
        """Whether the recording is all there, to the end that its scenario asks for."""
        last_s = self.duration_s - self.tick_s  # a duration need not end with a tick
        reaches = self.until_s >= last_s - TIME_SLACK_S
        return self.problem is None and self.finished and reaches

    @property
    def cut(self) -> str | None:
        """Where the recording ends before the run's planned end, in words; None where not."""
        if self.whole:
            return None
        ends = "ends" if self.finished else "is cut off: it ends"
        return f"the recording {ends} at {self.until_s:.4g} s of {self.duration_s:g} s"

    @property
    def inconclusive(self) -> str | None:
        """Why the recording neither passes nor fails; None where it does.

        A summary that is not true comes first: then its own reason is in doubt, too.
        """
        if self.differences:
            return _differing(self.differences)
        if self.contradictions:
            return f"{SUMMARY_FILE} contradicts itself: {self.contradictions[0]}"
        if self.file_differences:
            return _differing(self.file_differences)
        return self.doubt or self.cut

    @property
    def held(self) -> bool:
        """Whether the recorded run passes, and no file of it differs from its recording."""
        return self.problem is None and self.inconclusive is None and self.passes

    @property
    def exit_status(self) -> int:
        """0: held; 1: not held; 2: no such run, or no recording; 3: inconclusive."""
        if self.problem is not None and not self.damaged:
            return UNREADABLE
        if self.damaged or self.inconclusive is not None:
            return INCONCLUSIVE
        return HELD if self.held else NOT_HELD


def verify(run: Path) -> Verification:
    """Judge a run's recording again; ``run`` is its folder, or the recording itself."""
    recording = run / RECORDING_FILE if run.is_dir() else run
    if not recording.is_file() and any(run.glob("*/scenario.toml")):
        return Verification(run, problem=f"{run}: a folder of many runs; name one of them")
    try:
        readback = read_run_apart(recording)
        judged = verification_of(run, readback, rejudge(readback).judge)
        judged = compared(judged, recording.with_name(SUMMARY_FILE))
        summary = _read(recording.with_name(SUMMARY_FILE)) if judged.summary else None
        found = file_differences(recording.parent, readback, summary)
        return replace(judged, file_differences=tuple(found))
    except DamagedError as error:
        return Verification(run, problem=f"inconclusive: {_one_line(str(error))}", damaged=True)
    except RecordingError as error:
        damaged = run.is_dir() and recording.is_file()
        return Verification(run, problem=str(error), damaged=damaged)


def judged_again(run: Path, recording: Path) -> Verification:
    """Judge a recording again. Raises RecordingError."""
    readback = read_run_apart(recording)
    return verification_of(run, readback, rejudge(readback).judge)


def verification_of(run: Path, readback: Readback, judge: Judge) -> Verification:
    """Return what a recording shows by the judge that saw it."""
    scenario, found = readback.scenario, judge.shortcomings()
    ended_s = _ended_s(readback)
    return Verification(
        run=run,
        finished=readback.finished,
        exact=readback.exact,
        scenario=scenario.name,
        ticks=judge.ticks,
        until_s=readback.ticks[-1].time_s if readback.ticks else 0.0,
        duration_s=scenario.duration_s,
        tick_s=1.0 / scenario.fleet.tick_hz,
        expectations=tuple(judge.expectations()),
        min_separation_m=judge.min_separation_m,
        min_obstacle_distance_m=judge.min_obstacle_distance_m,
        turns_over_limit_fraction=judge.turns_over_limit_fraction,
        phases=tuple(_phases(judge)),
        recoveries=tuple(judge.recoveries),
        invariants=judge.invariants(),
        passes=judge.ticks > 0 and not any(found),
        outcome=_outcome(judge, ended_s is not None),
        idle_faults=scenario.expect.idle_faults,
        ended_s=ended_s,
        figures=_figures(readback, judge),
    )


def _ended_s(readback: Readback) -> Figure:
    """Return when the world was killed as planned [s]; None where it was not."""
    for event in readback.events:
        if isinstance(event, WorldStopped) and event.cause == "kill":
            return event.t_s
    return None


def _outcome(judge: Judge, cut: bool) -> str:
    """Return the outcome of the ticks that a judge saw. cut: whether the run ended early."""
    found = judge.shortcomings()
    if found.violated:
        return "fail"
    if cut:
        return "inconclusive"
    if not judge.ticks or found.unseen or found.missed:
        return "fail"
    return "inconclusive" if found.unjudged else "pass"


def _figures(readback: Readback, judge: Judge) -> dict[str, Any]:
    """Return the figures of a run that its recording shows, under the keys of summary.json."""
    scenario, last = readback.scenario, readback.ticks[-1:]
    packets = last[0].packets if last and readback.mode in REPEATABLE else {}
    ended_s = _ended_s(readback)
    if ended_s is not None and last and abs(ended_s - last[0].time_s) > TIME_SLACK_S:
        packets = {}  # the radio went on after the last tick
    figures: dict[str, Any] = {
        "scenario": scenario.name,
        "seed": scenario.seed,
        "mode": readback.mode,
        "agents": scenario.fleet.agents,
        "duration_s": scenario.slots / scenario.slot_hz if ended_s is None else ended_s,
        "expectations": [row.row for row in judge.expectations()],
        "coverage": [each.row for each in judge.coverage],
        "min_separation_m": judge.min_separation_m,
        "min_obstacle_distance_m": judge.min_obstacle_distance_m,
        "phases": [asdict(phase) for phase in _phases(judge)],
        "sub_formations": [queues.row for queues in judge.sub_formations],
        "recoveries": [msgspec.structs.asdict(recovery) for recovery in judge.recoveries],
        "encounters": [msgspec.to_builtins(each) for each in judge.clearance.encounters],
        "in_formation_fraction": judge.in_formation_fraction,
        "max_slot_error_m": judge.max_slot_error_m,
        "min_lambda2": judge.min_lambda2,
        "attitude_error_deg": judge.attitude_error_deg,
        "turns_over_limit_fraction": judge.turns_over_limit_fraction,
        "packets": packets,
        "invariants": {
            name: msgspec.structs.asdict(tally) for name, tally in judge.invariants().items()
        },
    }
    operated = readback.mode != "virtual"
    faults = FaultSpans(scenario, operated=operated).rows(in_order(readback.events))
    if faults is not None:
        figures["faults"] = faults
    return {key: _finite(value) for key, value in figures.items()}


def _phases(judge: Judge) -> Iterator[PhaseFigures]:
    for phase, queues in zip(judge.phases, judge.queues, strict=True):
        yield PhaseFigures(
            formation=phase.formation.name,
            from_s=phase.from_s,
            converged=phase.converge_s is not None,
            converge_s=phase.converge_s,
            timed_from_s=phase.timed_from_s,
            in_place_from_s=phase.in_place_from_s,
            residual_m=phase.residual_m,
            queues_converge_s=dict(zip(queues.names, queues.converge_s, strict=True)),
        )


def compared(judged: Verification, file: Path) -> Verification:
    """Return a judged recording with what differs in a summary."""
    if not file.is_file():
        doubt = f"no {SUMMARY_FILE}: the run has not finished, or was ended by force"
        return replace(judged, doubt=doubt)
    try:
        summary = _read(file)
    except (OSError, ValueError, RecursionError) as error:
        return replace(judged, doubt=f"{SUMMARY_FILE} cannot be read: {error}")
    shown = _shown(judged)
    if shown is None:
        shown = Shown(judged.figures, judged.outcome, judged.exact, judged.until_s)
        found = differences_in_part(summary, shown, judged.duration_s)
        uncompared = judged.cut
    else:
        found, uncompared = differences(summary, shown), None
    return replace(
        judged,
        summary=True,
        doubt=_doubt(summary),
        uncompared=uncompared,
        differences=tuple(found),
        contradictions=tuple(contradictions(summary, shown, judged.idle_faults)),
    )


def _read(summary: Path) -> Any:
    return json.loads(summary.read_text("utf-8"))


def _shown(judged: Verification) -> Shown | None:
    """Return what a recording shows of a run; None where it is shorter than the run.

    In virtual time a run that the scenario's kill of the world ended is recorded to its end, too.
    """
    if judged.whole or _is_of_killed_world(judged):
        return Shown(judged.figures, judged.outcome, judged.exact, judged.until_s)
    return None


def _is_of_killed_world(judged: Verification) -> bool:
    """Return whether a recording in virtual time reaches the planned kill of the world."""
    if judged.ended_s is None or not judged.finished or judged.figures["mode"] != "virtual":
        return False
    return judged.until_s > judged.ended_s - judged.tick_s - TIME_SLACK_S


def _doubt(summary: Any) -> str | None:
    """Return why a run is inconclusive by its summary; None where it is not."""
    if value_at(summary, "outcome") != "inconclusive":
        return None
    reason = summary.get("reason") or "inconclusive"
    return f"{SUMMARY_FILE}: {_one_line(str(reason))}"


def _finite(value: Any) -> Any:
    """Replace NaN and infinity by None, as summary.json does."""
    if isinstance(value, dict):
        return {key: _finite(inner) for key, inner in value.items()}
    if isinstance(value, list):
        return [_finite(inner) for inner in value]
    return None if isinstance(value, float) and not isfinite(value) else value


def _differing(differences: tuple[Difference, ...]) -> str:
    """Return which file differs in which figures: those of the first file."""
    file = differences[0].file
    keys = [each.key for each in differences if each.file == file]
    more = f" and {len(keys) - MAX_NAMED} more" if len(keys) > MAX_NAMED else ""
    return f"{file} differs in {', '.join(keys[:MAX_NAMED])}{more}"


def _one_line(text: str) -> str:
    """Return a text without line breaks and control characters, cut to a readable length."""
    words = "".join(each if each.isprintable() else " " for each in text).split()
    return shorten(" ".join(words), MAX_REASON, placeholder=" ...")
