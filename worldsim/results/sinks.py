"""Where a flight's ticks and events go as they happen: the recording and events.jsonl."""

from typing import Protocol

from worldsim.engine.step import Recorder
from worldsim.judge.run_events import RunEvent, as_row
from worldsim.judge.tick import Tick
from worldsim.judge.verdict import Figures
from worldsim.results.run_folder import RunDirectory
from worldsim.scenario.tables import Scenario


class ClosingRecorder(Recorder, Protocol):
    """A recorder that must be closed for its last ticks to be kept."""

    def close(self) -> None:
        """Write what is still to be written."""


class Sinks:
    """Keeps events in the run's folder, and hands everything to the recorder if there is one."""

    def __init__(self, directory: RunDirectory, recorder: ClosingRecorder | None) -> None:
        self._directory = directory
        self._recorder = recorder
        self.records_ticks = recorder is not None

    def tick(self, tick: Tick, figures: Figures) -> None:
        """Record one tick."""
        if self._recorder is not None:
            self._recorder.tick(tick, figures)

    def event(self, event: RunEvent) -> None:
        """Keep one event."""
        self._directory.event(as_row(event))
        if self._recorder is not None:
            self._recorder.event(event)

    def close(self) -> None:
        """Finish the recording."""
        if self._recorder is not None:
            self._recorder.close()


def open_sinks(
    directory: RunDirectory, scenario: Scenario, run: str, mode: str, recording: bool
) -> Sinks:
    """Open a run's notebook, with a recording or without."""
    if not recording:
        return Sinks(directory, None)
    # rerun costs a second and 90 MB: only the process that records pays for it.
    from worldsim.recording.recorder import RunRecorder  # noqa: PLC0415

    return Sinks(directory, RunRecorder(directory.recording, scenario, run, mode=mode))
