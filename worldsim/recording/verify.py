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
from worldsim.judge.verdict import Judge
from worldsim.recording.isolated_reader import read_run_apart
from worldsim.recording.layout import RECORDING_FILE, SUMMARY_FILE
from worldsim.recording.readback import DamagedError, Readback, RecordingError
from worldsim.recording.rejudged import in_order, rejudge

Figure = float | None
HELD, NOT_HELD, UNREADABLE, INCONCLUSIVE = 0, 1, 2, 3
TIME_SLACK_S = 1e-9
ABSENT = "no such key"
"""Stands for a value that is not there."""
ADDED_LATER = (
    "sub_formations",
    "in_formation_fraction",
    "max_slot_error_m",
    "margin",
    "min_lambda2",
    "I5",
    "timed_from_s",
    "asked_s",
    "overtaken_s",
    "changed",
)
"""Keys that an older summary lacks."""
MAX_NAMED = 4
"""Of more differences, the first are named."""
MAX_REASON = 300
"""Length of the reason for which a recording cannot be read [characters]."""
REPEATABLE = ("lockstep", "virtual")
"""Modes in which the radio's counters at the last tick are those of the summary."""


@dataclass(frozen=True, slots=True)
class Difference:
    """A figure of which summary and recording give different values."""

    key: str  # the path in summary.json, joined by dots
    summary: Any
    recording: Any


@dataclass(frozen=True, slots=True)
class PhaseFigures:
    """How the team came into one formation, under the keys of summary.json."""

    formation: str
    from_s: float
    converged: bool
    converge_s: Figure
    timed_from_s: Figure
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
    figures: dict[str, Any] = field(default_factory=dict)
    """Everything that was recomputed, under the keys of summary.json."""
    summary: bool = False
    """Whether there is a summary to compare with."""
    doubt: str | None = None
    """Why the recording proves nothing, from its summary; None: the summary gives no reason."""
    differences: tuple[Difference, ...] = ()

    @property
    def whole(self) -> bool:
        """Whether the recording is all there, to the end that its scenario asks for."""
        last_s = self.duration_s - self.tick_s  # a duration need not end with a tick
        reaches = self.until_s >= last_s - TIME_SLACK_S
        return self.problem is None and self.finished and reaches

    @property
    def inconclusive(self) -> str | None:
        """Why the recording neither passes nor fails; None where it does."""
        if self.doubt is None and not self.whole:
            ends = "ends" if self.finished else "is cut off: it ends"
            return f"the recording {ends} at {self.until_s:.4g} s of {self.duration_s:g} s"
        if self.doubt is None and self.differences:
            keys = ", ".join(each.key for each in self.differences[:MAX_NAMED])
            more = f" and {len(self.differences) - MAX_NAMED} more"
            return f"{SUMMARY_FILE} differs in {keys}{more * (len(self.differences) > MAX_NAMED)}"
        return self.doubt

    @property
    def held(self) -> bool:
        """Whether the recorded run passes, and no figure differs from the summary's."""
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
        return compared(judged_again(run, recording), recording.with_name(SUMMARY_FILE))
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
        figures=_figures(readback, judge),
    )


def _figures(readback: Readback, judge: Judge) -> dict[str, Any]:
    """Return the figures of a run that its recording shows, under the keys of summary.json."""
    scenario, last = readback.scenario, readback.ticks[-1:]
    packets = last[0].packets if last and readback.mode in REPEATABLE else {}
    figures: dict[str, Any] = {
        "scenario": scenario.name,
        "seed": scenario.seed,
        "mode": readback.mode,
        "agents": scenario.fleet.agents,
        "duration_s": scenario.slots / scenario.slot_hz,
        "expectations": [row.row for row in judge.expectations()],
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
            residual_m=phase.residual_m,
            queues_converge_s=dict(zip(queues.names, queues.converge_s, strict=True)),
        )


def compared(judged: Verification, file: Path) -> Verification:
    """Return a judged recording with what differs in a summary."""
    if not file.is_file():
        doubt = f"no {SUMMARY_FILE}: the run has not finished, or was ended by force"
        return replace(judged, doubt=doubt)
    try:
        summary = json.loads(file.read_text("utf-8"))
    except (OSError, ValueError, RecursionError) as error:
        return replace(judged, doubt=f"{SUMMARY_FILE} cannot be read: {error}")
    differences = tuple(_differences(summary, judged)) if judged.whole else ()
    return replace(judged, summary=True, doubt=_doubt(summary), differences=differences)


def _doubt(summary: Any) -> str | None:
    """Return why a run is inconclusive by its summary; None where it is not."""
    if _value_at(summary, "outcome") != "inconclusive":
        return None
    reason = summary.get("reason") or "inconclusive"
    return f"{SUMMARY_FILE}: {_one_line(str(reason))}"


def _differences(summary: Any, judged: Verification) -> Iterator[Difference]:
    """Yield the figures that differ; a figure that the summary lacks differs too."""
    for key, recorded in judged.figures.items():
        summarised = _value_at(summary, key)
        if summarised == ABSENT and (recorded in ([], {}) or key in ADDED_LATER):
            continue  # an older summary has no such list
        if key == "packets" and isinstance(summarised, dict):
            summarised = {name: summarised[name] for name in recorded if name in summarised}
        if key == "faults":
            operated = judged.figures["mode"] != "virtual"
            summarised = _comparable(summarised, recorded, operated)
        yield from _unequal(key, summarised, recorded)
    outcome = _value_at(summary, "outcome")
    recorded = "pass" if judged.passes else "fail"
    if str(outcome) not in {"inconclusive", recorded}:
        yield Difference("outcome", outcome, recorded)


def _comparable(faults: Any, recorded: dict[str, Any], operated: bool) -> Any:
    """Return a summary's faults by number, with the keys that a recording shows of each.

    operated: whether there may be faults that found no agent and left no event.
    """
    if not isinstance(faults, list) or not all(isinstance(each, dict) for each in faults):
        return faults
    found: dict[str, Any] = {}
    for each in faults:
        number = str(each.get("number"))
        if number in found:
            return faults
        if operated and number not in recorded and each.get("agents") == []:
            continue
        names = set(recorded.get(number) or each)
        found[number] = {name: value for name, value in each.items() if name in names}
    return found


def _unequal(key: str, summarised: Any, recorded: Any) -> Iterator[Difference]:
    """Yield the differences of two values and of all that they hold."""
    before, after = _items(summarised), _items(recorded)
    if after is None or (before is None and not after):
        # JSON has true and 1 apart, Python takes them for equal.
        if summarised != recorded or isinstance(summarised, bool) != isinstance(recorded, bool):
            yield Difference(key, summarised, recorded)
        return
    for name in dict.fromkeys((*after, *(before or {}))):
        summarised, recorded = (before or {}).get(name, ABSENT), after.get(name, ABSENT)
        if summarised == ABSENT and name in ADDED_LATER:
            continue
        yield from _unequal(f"{key}.{name}", summarised, recorded)


def _items(value: Any) -> dict[str, Any] | None:
    """Return what a table, or a list of tables, holds; None for a plain value."""
    if isinstance(value, list) and any(isinstance(each, dict) for each in value):
        return {str(index): each for index, each in enumerate(value)}
    return value if isinstance(value, dict) else None


def _value_at(summary: Any, key: str) -> Any:
    """Return the value of a key; ABSENT where there is none."""
    return summary.get(key, ABSENT) if isinstance(summary, dict) else ABSENT


def _finite(value: Any) -> Any:
    """Replace NaN and infinity by None, as summary.json does."""
    if isinstance(value, dict):
        return {key: _finite(inner) for key, inner in value.items()}
    if isinstance(value, list):
        return [_finite(inner) for inner in value]
    return None if isinstance(value, float) and not isfinite(value) else value


def _one_line(text: str) -> str:
    """Return a text without line breaks and control characters, cut to a readable length."""
    words = "".join(each if each.isprintable() else " " for each in text).split()
    return shorten(" ".join(words), MAX_REASON, placeholder=" ...")
