"""The verdict once more, from the recording alone, held against what the run itself said.

A fresh judge sees the recorded ticks. The rows are the very ones that the first judge saw, so its
figures are equal, not close: any difference means that summary and recording do not belong
together.
"""

import json
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from worldsim.judge.recovery import Recovery
from worldsim.judge.run_events import RunEvent
from worldsim.judge.tick import Tick
from worldsim.judge.verdict import Expectation, Judge
from worldsim.recording.readback import Readback, RecordingError, read_run

RECORDING = "run.rrd"
SUMMARY = "summary.json"
SAME_TIME_S = 1e-6
"""Events tell their time to the microsecond."""
HELD, NOT_HELD, NOTHING_TO_JUDGE = 0, 1, 2

Figure = float | None


@dataclass(frozen=True, slots=True)
class Difference:
    """A figure that the summary tells otherwise than the recording does."""

    key: str
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
    """What a recording shows.

    ticks, until_s: how much of the run it holds. summary: whether there was one to compare with;
    differences: where it disagrees. problem: why nothing could be judged, else None.
    """

    run: Path
    problem: str | None = None
    scenario: str | None = None
    ticks: int = 0
    until_s: float = 0.0
    duration_s: float = 0.0
    expectations: tuple[Expectation, ...] = ()
    min_separation_m: Figure = None
    min_obstacle_distance_m: Figure = None
    turns_over_limit_fraction: Figure = None
    phases: tuple[PhaseFigures, ...] = ()
    recoveries: tuple[Recovery, ...] = ()
    invariants: dict[str, dict[str, int]] = field(default_factory=dict)
    summary: bool = False
    differences: tuple[Difference, ...] = ()

    @property
    def whole(self) -> bool:
        """Whether the recording reaches the end that its scenario asks for."""
        return self.problem is None and self.until_s >= self.duration_s - 1e-9

    @property
    def held(self) -> bool:
        """Whether the run shows what it must, and no figure differs from the summary's."""
        return self.shown and not self.differences

    @property
    def shown(self) -> bool:
        """Whether every expectation held and no invariant was violated, at one tick or more."""
        violations = sum(counts["violations"] for counts in self.invariants.values())
        return self.ticks > 0 and not violations and all(row.held for row in self.expectations)

    @property
    def exit_status(self) -> int:
        """0: held; 1: not; 2: no such run, or no recording in it that can be read."""
        if self.problem is not None:
            return NOTHING_TO_JUDGE
        return HELD if self.held else NOT_HELD


def verify(run: Path) -> Verification:
    """Judge a run's recording again; ``run`` is its folder, or the recording itself."""
    recording = run / RECORDING if run.is_dir() else run
    try:
        judged = _judged(run, recording)
        return _compared(judged, recording.with_name(SUMMARY))
    except RecordingError as error:
        return Verification(run, problem=str(error))


def _judged(run: Path, recording: Path) -> Verification:
    readback = read_run(recording)
    judge = _seen(readback)
    return Verification(
        run=run,
        scenario=readback.scenario.name,
        ticks=judge.ticks,
        until_s=readback.ticks[-1].time_s if readback.ticks else 0.0,
        duration_s=readback.scenario.duration_s,
        expectations=tuple(judge.expectations()),
        min_separation_m=judge.min_separation_m,
        min_obstacle_distance_m=judge.min_obstacle_distance_m,
        turns_over_limit_fraction=judge.turns_over_limit_fraction,
        phases=tuple(
            PhaseFigures(
                phase.formation.name,
                phase.from_s,
                phase.converge_s is not None,
                phase.converge_s,
                phase.residual_m,
            )
            for phase in judge.phases
        ),
        recoveries=tuple(judge.recoveries),
        invariants=judge.invariants(),
    )


def _seen(readback: Readback) -> Judge:
    """Return a judge that saw the ticks, and heard before each of what had happened by then."""
    judge, heard = Judge(readback.scenario), 0
    events = sorted(readback.events, key=lambda event: event.t_s)
    for tick in readback.ticks:
        while heard < len(events) and _before(events[heard], tick):
            judge.note(events[heard])
            heard += 1
        judge.see(tick)
    return judge


def _before(event: RunEvent, tick: Tick) -> bool:
    """Whether the run's judge was told of an event before it saw a tick.

    At one time, what was meant comes first; a process that died of itself is noticed after it.
    """
    slack_s = -SAME_TIME_S if getattr(event, "planned", True) is False else SAME_TIME_S
    return event.t_s <= tick.time_s + slack_s


def _compared(judged: Verification, summary: Path) -> Verification:
    if not summary.is_file():
        return judged
    try:
        told = json.loads(summary.read_text())
    except ValueError as error:
        raise RecordingError(f"{summary}: cannot be read: {error}") from error
    return replace(judged, summary=True, differences=tuple(_differences(told, judged)))


def _differences(told: Any, judged: Verification) -> Iterator[Difference]:
    """Return what the summary tells otherwise; a figure that it lacks is told otherwise too."""
    for key, shown in _figures(judged).items():
        said = _at(told, key)
        if said != shown:
            yield Difference(key, said, shown)
    if _at(told, "outcome") == "pass" and not judged.shown:
        yield Difference("outcome", "pass", "fail")


def _figures(judged: Verification) -> dict[str, Any]:
    """Return what must be equal, by its path in summary.json."""
    figures: dict[str, Any] = {
        "min_separation_m": judged.min_separation_m,
        "min_obstacle_distance_m": judged.min_obstacle_distance_m,
        "turns_over_limit_fraction": judged.turns_over_limit_fraction,
    }
    for name, counts in judged.invariants.items():
        figures[f"invariants.{name}"] = counts
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


def _at(told: Any, path: str) -> Any:
    """Return what stands at a path of keys and places in a list; None when nothing does."""
    for key in path.split("."):
        try:
            told = told[int(key)] if isinstance(told, list) else told[key]
        except (KeyError, IndexError, TypeError, ValueError):
            return None
    return told
