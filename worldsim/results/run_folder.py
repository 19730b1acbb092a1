"""The folder of one run: made once, never overwritten, readable at any moment of the run."""

import json
import sys
from contextlib import suppress
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from worldsim.recording.layout import RECORDING_FILE, SUMMARY_FILE
from worldsim.scenario.file import dump
from worldsim.scenario.tables import Scenario

RUNS = Path("runs")
USERS = "users"


class RunDirectoryError(Exception):
    """A run's folder that cannot be made or written; one line that names it and says why."""

    def __init__(self, path: Path, detail: str) -> None:
        super().__init__(path, detail)

    def __str__(self) -> str:
        return "{}: {}".format(*self.args)


class RunWriteError(RunDirectoryError):
    """A run whose result could not be kept, on a full disk say."""


class RunDirectory:
    """Where one run keeps what it shows: scenario, events, logs, recording, summary."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.recording = path / RECORDING_FILE
        self.logs = path / "logs"
        self.summary = path / SUMMARY_FILE
        self._events = path / "events.jsonl"
        self._events_lost = False

    @classmethod
    def create(cls, path: Path | None, scenario: Scenario) -> "RunDirectory":
        """Make the folder with the resolved scenario in it; None: one named after the time.

        Raises RunDirectoryError when there is something at ``path``, or it cannot be written.
        """
        directory = cls(make_folder(path, scenario.name))
        try:
            directory.logs.mkdir()
            (directory.path / "scenario.toml").write_text(dump(scenario), encoding="utf-8")
            directory._events.touch()
        except OSError as error:
            raise unwritable(directory.path, error) from error
        return directory

    def event(self, event: dict[str, Any]) -> None:
        """Append one event as a line.

        A disk that fails must not stop a fleet in flight: it is said once, on stderr.
        """
        try:
            with self._events.open("a", encoding="utf-8") as file:
                file.write(json.dumps(event, allow_nan=False) + "\n")
        except OSError as error:
            if not self._events_lost:
                print(f"{self._events}: {_reason(error)}; events are lost", file=sys.stderr)
            self._events_lost = True

    @property
    def users(self) -> Path:
        """The passwords of a run's processes, while it lasts."""
        return self.path / USERS

    def nothing_flew(self) -> None:
        """Take away what looks like a flight; scenario and logs stay, and tell why there is none.

        Raises RunWriteError.
        """
        try:
            for file in (self.recording, self.summary, self._events):
                file.unlink(missing_ok=True)
        except OSError as error:
            raise RunWriteError(self.path, _reason(error)) from error

    def write_summary(self, summary: dict[str, Any]) -> None:
        """Write summary.json whole or not at all. Raises RunWriteError, on a full disk say."""
        write_json(self.summary, summary)


def make_folder(path: Path | None, name: str) -> Path:
    """Make a new folder, ``runs/<name>-<UTC time>`` for None. Raises RunDirectoryError."""
    chosen = path if path is not None else _named_after_now(name)
    if chosen.exists():
        raise RunDirectoryError(chosen, "exists; a run is never overwritten")
    try:
        chosen.mkdir(parents=True)
    except OSError as error:
        raise RunDirectoryError(chosen, f"cannot be made: {_reason(error)}") from error
    return chosen


def write_json(path: Path, content: dict[str, Any]) -> None:
    """Write strict JSON so that a reader sees all of it or none, or raise RunWriteError."""
    draft = path.with_suffix(".part")
    try:
        draft.write_text(json.dumps(content, indent=2, allow_nan=False) + "\n", encoding="utf-8")
        draft.replace(path)
    except OSError as error:
        with suppress(OSError):
            draft.unlink(missing_ok=True)
        raise RunWriteError(path, _reason(error)) from error


def unwritable(path: Path, error: OSError) -> RunDirectoryError:
    """Return what is said of a file that a run cannot start without."""
    return RunDirectoryError(path, _reason(error))


def _named_after_now(name: str) -> Path:
    stamp = datetime.now(UTC).strftime("%Y%m%dT%H%M%SZ")
    chosen, again = RUNS / f"{name}-{stamp}", 1
    while chosen.exists():
        again += 1
        chosen = RUNS / f"{name}-{stamp}-{again}"
    return chosen


def _reason(error: OSError) -> str:
    return (error.strerror or str(error)).lower()
