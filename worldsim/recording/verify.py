"""The verdict recomputed from a recording alone, and compared with the run's summary.

A new judge sees the recorded ticks. They are the rows that the run's judge saw, so its figures are
equal, not merely close: any difference means that summary and recording do not belong together.
"""

import json
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import msgspec

from worldsim.judge.event import PlannedEvent
from worldsim.judge.invariants import InvariantTally
from worldsim.judge.phase import Phase
from worldsim.judge.recovery import Recovery
from worldsim.judge.run_events import RunEvent
from worldsim.judge.tick import Tick
from worldsim.judge.verdict import Expectation, Judge
from worldsim.recording.layout import RECORDING_FILE, SUMMARY_FILE
from worldsim.recording.readback import Readback, RecordingError, read_run

EVENT_TIME_SLACK_S = 1e-6
"""Event times are rounded to the microsecond."""
HELD, NOT_HELD, UNREADABLE, INCONCLUSIVE = 0, 1, 2, 3
TIME_SLACK_S = 1e-9

Figure = float | None


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
    residual_m: Figure


@dataclass(frozen=True, slots=True)
class Verification:
    """What a recording shows, and where the run's summary differs."""

    run: Path
    problem: str | None = None
    """Why nothing could be judged, in one line; None where the recording was judged."""
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
    summary: bool = False
    """Whether there is a summary to compare with."""
    doubt: str | None = None
    """Why the recording proves nothing, from its summary; None: the summary gives no reason."""
    differences: tuple[Difference, ...] = ()

    @property
    def whole(self) -> bool:
        """Whether the recording reaches the end that its scenario asks for."""
        last_s = self.duration_s - self.tick_s  # a duration need not end with a tick
        return self.problem is None and self.until_s >= last_s - TIME_SLACK_S

    @property
    def inconclusive(self) -> str | None:
        """Why the recording neither passes nor fails; None where it does."""
        if self.doubt is None and not self.whole:
            return f"the recording ends at {self.until_s:.4g} s of {self.duration_s:g} s"
        return self.doubt

    @property
    def held(self) -> bool:
        """Whether the recorded run passes, and no figure differs from the summary's."""
        return self.inconclusive is None and self.passes and not self.differences

    @property
    def passes(self) -> bool:
        """Whether every expectation held and no invariant was violated, at one tick or more."""
        violations = sum(tally.violations for tally in self.invariants.values())
        return self.ticks > 0 and not violations and all(row.held for row in self.expectations)

    @property
    def exit_status(self) -> int:
        """0: held; 1: not held; 2: no such run, or no readable recording; 3: inconclusive."""
        if self.problem is not None:
            return UNREADABLE
        if self.inconclusive is not None:
            return INCONCLUSIVE
        return HELD if self.held else NOT_HELD


def verify(run: Path) -> Verification:
    """Judge a run's recording again; ``run`` is its folder, or the recording itself."""
    recording = run / RECORDING_FILE if run.is_dir() else run
    if not recording.is_file() and any(run.glob("*/scenario.toml")):
        return Verification(run, problem=f"{run}: a folder of many runs; name one of them")
    try:
        judged = _judged(run, recording)
        return _compared(judged, recording.with_name(SUMMARY_FILE))
    except RecordingError as error:
        return Verification(run, problem=str(error))


def _judged(run: Path, recording: Path) -> Verification:
    readback = read_run(recording)
    judge = _judge_of(readback)
    return Verification(
        run=run,
        scenario=readback.scenario.name,
        ticks=judge.ticks,
        until_s=readback.ticks[-1].time_s if readback.ticks else 0.0,
        duration_s=readback.scenario.duration_s,
        tick_s=1.0 / readback.scenario.fleet.tick_hz,
        expectations=tuple(judge.expectations()),
        min_separation_m=judge.min_separation_m,
        min_obstacle_distance_m=judge.min_obstacle_distance_m,
        turns_over_limit_fraction=judge.turns_over_limit_fraction,
        phases=tuple(_phase_figures(phase) for phase in judge.phases),
        recoveries=tuple(judge.recoveries),
        invariants=judge.invariants(),
    )


def _phase_figures(phase: Phase) -> PhaseFigures:
    return PhaseFigures(
        formation=phase.formation.name,
        from_s=phase.from_s,
        converged=phase.converge_s is not None,
        converge_s=phase.converge_s,
        residual_m=phase.residual_m,
    )


def _judge_of(readback: Readback) -> Judge:
    """Return a judge that took the recorded ticks and events, in the run's order."""
    judge, noted = Judge(readback.scenario), 0
    events = sorted(readback.events, key=lambda event: event.t_s)
    for tick in readback.ticks:
        while noted < len(events) and _comes_before(events[noted], tick):
            judge.handle_event(events[noted])
            noted += 1
        judge.see(tick)
    return judge


def _comes_before(event: RunEvent, tick: Tick) -> bool:
    """Return whether the run's judge took an event before a tick.

    At equal times a planned event comes before the tick, and an unplanned exit is noticed after it.
    """
    unplanned = isinstance(event, PlannedEvent) and not event.planned
    slack_s = -EVENT_TIME_SLACK_S if unplanned else EVENT_TIME_SLACK_S
    return event.t_s <= tick.time_s + slack_s


def _compared(judged: Verification, file: Path) -> Verification:
    if not file.is_file():
        doubt = f"no {SUMMARY_FILE}: the run has not finished, or was ended by force"
        return replace(judged, doubt=doubt)
    try:
        summary = json.loads(file.read_text())
    except ValueError as error:
        raise RecordingError(f"{file}: cannot be read: {error}") from error
    differences = tuple(_differences(summary, judged))
    return replace(judged, summary=True, doubt=_doubt(summary), differences=differences)


def _doubt(summary: Any) -> str | None:
    """Return why a run is inconclusive by its summary; None where it is not."""
    if _value_at(summary, "outcome") != "inconclusive":
        return None
    reason = _value_at(summary, "reason")
    return f"{SUMMARY_FILE}: {reason or 'inconclusive'}"


def _differences(summary: Any, judged: Verification) -> Iterator[Difference]:
    """Yield the figures that differ; a figure that the summary lacks differs too."""
    for key, recorded in _figures_by_path(judged).items():
        summarised = _value_at(summary, key)
        if summarised != recorded:
            yield Difference(key=key, summary=summarised, recording=recorded)
    if _value_at(summary, "outcome") == "pass" and not judged.passes:
        yield Difference(key="outcome", summary="pass", recording="fail")


def _figures_by_path(judged: Verification) -> dict[str, object]:
    """Return the figures that must be equal, by their path in summary.json."""
    figures: dict[str, object] = {
        "min_separation_m": judged.min_separation_m,
        "min_obstacle_distance_m": judged.min_obstacle_distance_m,
        "turns_over_limit_fraction": judged.turns_over_limit_fraction,
    }
    for name, tally in judged.invariants.items():
        figures[f"invariants.{name}"] = msgspec.structs.asdict(tally)
    for index, phase in enumerate(judged.phases):
        for key in ("formation", "from_s", "converged", "converge_s", "residual_m"):
            figures[f"phases.{index}.{key}"] = getattr(phase, key)
    for index, recovery in enumerate(judged.recoveries):
        for key in ("t_s", "kind", "agents", "reformed_s"):
            figures[f"recoveries.{index}.{key}"] = getattr(recovery, key)
    for index, row in enumerate(judged.expectations):
        for key in ("name", "wanted", "got", "held"):
            figures[f"expectations.{index}.{key}"] = getattr(row, key)
    return figures


def _value_at(summary: Any, path: str) -> Any:
    """Return the value at a path of keys and list indices; None where there is none."""
    value = summary
    for key in path.split("."):
        try:
            value = value[int(key)] if isinstance(value, list) else value[key]
        except (KeyError, IndexError, TypeError, ValueError):
            return None
    return value
