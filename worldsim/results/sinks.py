"""The sinks of a run's ticks and events: the recording and events.jsonl."""

from collections.abc import Sequence
from typing import Protocol

from agent.messages import Believed, Observation, Report
from worldsim.engine.step import Recorder
from worldsim.judge.run_events import RunEvent, as_row
from worldsim.judge.tick import Tick
from worldsim.judge.verdict import Figures, Judge
from worldsim.results.expectation_text import (
    Circumstances,
    PhaseTimes,
    RecoveryRow,
    expectation_texts,
)
from worldsim.results.run_folder import RunDirectory
from worldsim.scenario.tables import Scenario


class ClosingRecorder(Recorder, Protocol):
    """A recorder that writes its last ticks when it is closed."""

    def close(self, found: Sequence[str] = ()) -> None:
        """Write the rest of the recording, and what the run showed of each expectation."""


class Sinks:
    """Writes events to the run's folder, and ticks and events to the recorder if there is one."""

    def __init__(self, directory: RunDirectory, recorder: ClosingRecorder | None) -> None:
        self._directory = directory
        self._recorder = recorder
        self.records_ticks = recorder is not None

    def tick(self, tick: Tick, figures: Figures) -> None:
        """Record one tick."""
        if self._recorder is not None:
            self._recorder.tick(tick, figures)

    def observe(self, observations: Sequence[tuple[int, Observation]]) -> None:
        """Record what some agents observe, each given with its agent."""
        if self._recorder is not None:
            self._recorder.observe(observations)

    def believe(self, agent: int, slot: int, believed: Believed) -> None:
        """Record where an agent takes its neighbours to be at a slot."""
        if self._recorder is not None:
            self._recorder.believe(agent, slot, believed)

    def report(self, agent: int, slot: int, report: Report) -> None:
        """Record what an agent's controller tells at a slot."""
        if self._recorder is not None:
            self._recorder.report(agent, slot, report)

    def fill_disk(self, full: bool) -> None:
        """Let every write of events and recorder fail as on a full disk, or no longer."""
        self._directory.fill_disk(full)
        if self._recorder is not None:
            self._recorder.fill_disk(full)

    @property
    def failed_writes(self) -> int:
        """Number of writes that failed so far."""
        recorder = self._recorder
        return self._directory.failed_writes + (recorder.failed_writes if recorder else 0)

    def event(self, event: RunEvent) -> None:
        """Write one event."""
        self._directory.event(as_row(event))
        if self._recorder is not None:
            self._recorder.event(event)

    def close(self, judge: Judge | None = None, ended_s: float = 0.0) -> None:
        """Finish the recording; judge: of a run that ended at a time [s]; None: it broke off."""
        if self._recorder is not None:
            self._recorder.close(_found(judge, ended_s) if judge is not None else ())


def _found(judge: Judge, ended_s: float) -> list[str]:
    """Return what a run that ended at a time [s] showed of each expectation, one text for each."""
    phases = [PhaseTimes.of(phase) for phase in judge.phases]
    recoveries: list[RecoveryRow] = [
        {
            "t_s": row.t_s,
            "kind": row.kind,
            "agents": row.agents,
            "reformed_s": row.reformed_s,
            "timed_from_s": row.timed_from_s,
            "asked_s": row.asked_s,
            "overtaken_s": row.overtaken_s,
            "in_place_from_s": row.in_place_from_s,
            "changed": row.changed,
        }
        for row in judge.recoveries
    ]
    rows = [expectation.row for expectation in judge.expectations()]
    texts = expectation_texts(rows, Circumstances(ended_s, phases, recoveries))
    words = {True: "met", False: "NOT MET", None: "open"}
    return [f"{words[row['held']]}: {text}" for row, text in zip(rows, texts, strict=True)]


def open_sinks(
    directory: RunDirectory, scenario: Scenario, run: str, mode: str, recording: bool
) -> Sinks:
    """Open the sinks of a run, with a recording or without one."""
    if not recording:
        return Sinks(directory, None)
    # Importing rerun takes a second and 90 MB: only the process that records does it.
    from worldsim.recording.recorder import RunRecorder  # noqa: PLC0415

    recorder = RunRecorder(
        directory.recording, scenario, run, mode=mode, report=directory.lose_recording
    )
    return Sinks(directory, recorder)
