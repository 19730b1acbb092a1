"""The folder of one run: created once, never overwritten, readable at any moment of the run."""

import json
import os
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from datetime import UTC, datetime
from pathlib import Path
from shutil import rmtree
from typing import Any, TypeVar, cast

from worldsim.recording.layout import RECORDING_FILE, SUMMARY_FILE
from worldsim.scenario.file import dump
from worldsim.scenario.tables import Scenario

RUNS = Path("runs")
RESERVE = ".reserve"
"""A file that keeps room on the disk, while the run lasts."""
RESERVED_B = 128 * 1024
"""Room for a summary [bytes]."""
Content = TypeVar("Content", bound=Mapping[str, Any])
INPUTS = "inputs"
"""The folder of what agents were given, where they kept it; see agent.input_log."""
USERS = "users"
"""The file of the processes' passwords, there while the run lasts."""


FULL = Path("/dev/full")
"""A file on which the kernel lets every write fail as on a full disk."""


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
        self.inputs = path / INPUTS
        self._events = path / "events.jsonl"
        self._events_lost = False
        self._appended = self._events
        """Where events are appended to."""
        self.failed_writes = 0
        """Number of events that could not be written."""
        self.on_loss: Callable[[str], None] = _print_loss
        """Gets what is lost, and why, in one line, the first time."""
        self.lost: str | None = None
        """What of the results was lost first, and why; None: nothing."""

    @classmethod
    def create(cls, path: Path | None, scenario: Scenario) -> "RunDirectory":
        """Create the folder with the resolved scenario in it; None: one named after the time.

        It keeps room for the summary on the disk. Raises RunDirectoryError when ``path`` exists or
        cannot be written; then nothing is left of it.
        """
        directory = cls(make_folder(path, scenario.name))
        try:
            directory.logs.mkdir()
            (directory.path / "scenario.toml").write_text(dump(scenario), encoding="utf-8")
            directory._events.touch()
            _keep_room(directory.path, RESERVED_B)
        except OSError as error:
            rmtree(directory.path, ignore_errors=True)
            raise unwritable(directory.path, error) from error
        return directory

    def event(self, event: dict[str, Any]) -> None:
        """Append one event as a line of JSON.

        A failing disk must not stop a running fleet: it is reported once, on stderr.
        """
        try:
            with self._appended.open("a", encoding="utf-8") as file:
                file.write(json.dumps(event, allow_nan=False) + "\n")
        except OSError as error:
            self.failed_writes += 1
            if not self._events_lost:
                self._lose(f"{self._events}: {_reason(error)}; events are lost")
            self._events_lost = True

    def fill_disk(self, full: bool) -> None:
        """Let events meet a full disk, or no longer."""
        self._appended = FULL if full else self._events

    def lose_recording(self, text: str) -> None:
        """Report on stderr that the recording ends, and why, in one line."""
        self._lose(f"recording: {text}")

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
            (self.path / RESERVE).unlink(missing_ok=True)
        except OSError as error:
            raise RunWriteError(self.path, _reason(error)) from error

    def write_summary(self, summary: Content) -> Content:
        """Write summary.json completely or not at all, and return it. Raises RunWriteError.

        A run of which results were lost is no pass: its summary says so, besides what else makes it
        inconclusive.
        """
        written: Any = summary
        if self.lost is not None and summary["outcome"] != "fail":
            others = (summary["reason"],) if summary["reason"] else ()
            reason = "; ".join((f"results were lost: {self.lost}", *others))
            written = {**summary, "outcome": "inconclusive", "reason": reason}
        _free_room(self.path)
        write_json(self.summary, written)
        return cast("Content", written)

    def free_room(self) -> None:
        """Give back the room that was kept for a summary which the world did not write."""
        _free_room(self.path)

    def _lose(self, text: str) -> None:
        self.lost = self.lost or text
        self.on_loss(text)


@contextmanager
def room_reserved(folder: Path, room_b: int) -> Iterator[None]:
    """Keep room on the disk for a file in a new folder, until this block is left [bytes].

    Where a RunDirectoryError leaves the block, nothing has been written, and the folder is removed.
    Raises RunDirectoryError where there is no room.
    """
    try:
        try:
            _keep_room(folder, room_b)
        except OSError as error:
            raise unwritable(folder, error) from error
        yield
    except RunDirectoryError:
        rmtree(folder, ignore_errors=True)
        raise
    finally:
        _free_room(folder)


def _print_loss(text: str) -> None:
    # Stderr may be a file on the same full disk: then nothing can be printed.
    with suppress(OSError):
        print(text, file=sys.stderr, flush=True)


def make_folder(path: Path | None, name: str) -> Path:
    """Create a new folder, ``runs/<name>-<UTC time>`` for None. Raises RunDirectoryError."""
    chosen = path if path is not None else folder_named_after_now(name)
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


def folder_named_after_now(name: str) -> Path:
    """Return a new folder's name, ``runs/<name>-<UTC time>``; it is not made."""
    stamp = datetime.now(UTC).strftime("%Y%m%dT%H%M%SZ")
    chosen, count = RUNS / f"{name}-{stamp}", 1
    while chosen.exists():
        count += 1
        chosen = RUNS / f"{name}-{stamp}-{count}"
    return chosen


def _keep_room(folder: Path, room_b: int) -> None:
    with (folder / RESERVE).open("xb") as file:
        os.posix_fallocate(file.fileno(), 0, room_b)


def _free_room(folder: Path) -> None:
    with suppress(OSError):
        (folder / RESERVE).unlink(missing_ok=True)


def _reason(error: OSError) -> str:
    return (error.strerror or str(error)).lower()
