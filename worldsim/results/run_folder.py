"""The folder of one run: created once, never overwritten, readable at any moment of the run."""

import json
import sys
from collections.abc import Mapping
from contextlib import suppress
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from worldsim.recording.layout import RECORDING_FILE, SUMMARY_FILE
from worldsim.scenario.file import dump
from worldsim.scenario.tables import Scenario

RUNS = Path("runs")
USERS = "users"
"""The file of the processes' passwords, there while the run lasts."""


class RunDirectoryError(Exception):
    """A run's folder cannot be created or written; one line with the path and the reason."""

    def __init__(self, path: Path, detail: str) -> None:
        super().__init__(path, detail)

    def __str__(self) -> str:
        return "{}: {}".format(*self.args)


class RunWriteError(RunDirectoryError):
    """A run's result cannot be written, for example on a full disk."""


class RunDirectory:
    """The files of one run: scenario, events, logs, recording, summary."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.recording = path / RECORDING_FILE
        self.logs = path / "logs"
        self.summary = path / SUMMARY_FILE
        self._events = path / "events.jsonl"
        self._events_lost = False

    @classmethod
    def create(cls, path: Path | None, scenario: Scenario) -> "RunDirectory":
        """Create the folder with the resolved scenario in it; None: one named after the time.

        Raises RunDirectoryError when ``path`` exists or cannot be written.
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
        """Append one event as a line of JSON.

        A failing disk must not stop a running fleet: it is reported once, on stderr.
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
        """The file of the processes' passwords, there while the run lasts."""
        return self.path / USERS

    def remove_results(self) -> None:
        """Remove recording, summary and events of a run that never started.

        Scenario and logs stay, for the reason. Raises RunWriteError.
        """
        try:
            for file in (self.recording, self.summary, self._events):
                file.unlink(missing_ok=True)
        except OSError as error:
            raise RunWriteError(self.path, _reason(error)) from error

    def write_summary(self, summary: Mapping[str, Any]) -> None:
        """Write summary.json completely or not at all. Raises RunWriteError."""
        write_json(self.summary, summary)


def make_folder(path: Path | None, name: str) -> Path:
    """Create a new folder, ``runs/<name>-<UTC time>`` for None. Raises RunDirectoryError."""
    chosen = path if path is not None else _named_after_now(name)
    if chosen.exists():
        raise RunDirectoryError(chosen, "exists; a run is never overwritten")
    try:
        chosen.mkdir(parents=True)
    except OSError as error:
        raise RunDirectoryError(chosen, f"cannot be created: {_reason(error)}") from error
    return chosen


def write_json(path: Path, content: Mapping[str, Any]) -> None:
    """Write strict JSON so that a reader sees all of it or nothing. Raises RunWriteError."""
    draft = path.with_suffix(".part")
    try:
        draft.write_text(json.dumps(content, indent=2, allow_nan=False) + "\n", encoding="utf-8")
        draft.replace(path)
    except OSError as error:
        with suppress(OSError):
            draft.unlink(missing_ok=True)
        raise RunWriteError(path, _reason(error)) from error


def unwritable(path: Path, error: OSError) -> RunDirectoryError:
    """Return the error for a file without which a run cannot start."""
    return RunDirectoryError(path, _reason(error))


def _named_after_now(name: str) -> Path:
    stamp = datetime.now(UTC).strftime("%Y%m%dT%H%M%SZ")
    chosen, count = RUNS / f"{name}-{stamp}", 1
    while chosen.exists():
        count += 1
        chosen = RUNS / f"{name}-{stamp}-{count}"
    return chosen


def _reason(error: OSError) -> str:
    return (error.strerror or str(error)).lower()
