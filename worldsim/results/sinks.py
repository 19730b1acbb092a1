"""The sinks of a run's ticks and events: the recording and events.jsonl."""

from typing import Protocol

from worldsim.engine.step import Recorder
from worldsim.judge.run_events import RunEvent, as_row
from worldsim.judge.tick import Tick
from worldsim.judge.verdict import Figures
from worldsim.results.run_folder import RunDirectory
from worldsim.scenario.tables import Scenario


class ClosingRecorder(Recorder, Protocol):
    """A recorder that writes its last ticks when it is closed."""

    def close(self) -> None:
        """Write the rest of the recording."""


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

    def close(self) -> None:
        """Finish the recording."""
        if self._recorder is not None:
            self._recorder.close()


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
