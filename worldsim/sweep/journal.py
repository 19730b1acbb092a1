"""The folder of a sweep: what it is, in sweep.json, and a line for each finished flight.

A sweep that was cut off goes on in its folder: flights whose line is there are not flown again. A
line that was cut off itself is dropped. A folder of another sweep is refused.
"""

import fcntl
import json
import os
from pathlib import Path
from typing import Any, TypedDict

from worldsim.results.run_folder import RunDirectoryError, RunWriteError, unwritable, write_json
from worldsim.sweep.flight_row import FlightRow
from worldsim.sweep.plan import Axis, FlightKey, Plan

IDENTITY, LINES = "sweep.json", "flights.jsonl"
SCHEMA = 1
ANOTHER = "take another --out, or remove it"
SAME = {
    "scenario": "the scenario",
    "vary": "what is varied",
    "content_sha256": "the scenario's content, or a --set",
    "controllers": "the code of a controller",
    "version": "the version of qswarm",
    "commit": "the commit of qswarm",
    "python": "the version of Python",
    "packages": "the version of a package",
}
"""Keys of an identity that must be the same, in words."""


class Identity(TypedDict):
    """What a sweep is: two with the same identity fly the same."""

    schema: int
    scenario: str
    vary: list[tuple[str, list[str]]]  # keys with their values
    seeds: tuple[int, int]  # the end excluded
    content_sha256: str  # of the scenarios of all cells with the first seed
    controllers: dict[str, str]  # SHA-256 of a user's controllers, by name
    version: str | None
    commit: str | None
    commit_dirty: bool | None
    python: str
    packages: dict[str, str | None]


class Journal:
    """The folder of one sweep, open for writing; ``close`` it. One process at a time holds it."""

    def __init__(self, folder: Path, identity: Identity) -> None:
        """Open the folder, new or of the same sweep. Raises RunDirectoryError otherwise."""
        self.folder = folder
        self.rows: dict[FlightKey, FlightRow] = {}
        """The finished flights."""
        before = _checked(folder, identity)
        try:
            folder.mkdir(parents=True, exist_ok=True)
            self._file = (folder / LINES).open("a+b")
            self._lock()
            self._read()
        except OSError as error:
            raise unwritable(folder, error) from error
        if before != _plain(identity):
            write_json(folder / IDENTITY, identity)

    def append(self, row: FlightRow) -> None:
        """Write a flight's line, unless the flight has one. Raises RunWriteError."""
        key = FlightKey(row["cell"], row["seed"])
        if key in self.rows:
            return
        try:
            self._file.write(json.dumps(row, allow_nan=False).encode() + b"\n")
            self._file.flush()
        except OSError as error:
            raise RunWriteError(self.folder / LINES, error.strerror or str(error)) from error
        self.rows[key] = row

    def close(self) -> None:
        """Close the file, which lets another process go on."""
        self._file.close()

    def _lock(self) -> None:
        try:
            fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            self._file.close()
            raise RunDirectoryError(self.folder, "another process flies this sweep") from None

    def _read(self) -> None:
        self._file.seek(0)
        whole = 0
        for line in self._file:
            row = _row(line)
            if row is None:
                break
            whole += len(line)
            self.rows.setdefault(FlightKey(row["cell"], row["seed"]), row)
        os.truncate(self._file.fileno(), whole)


def read_sweep(folder: Path) -> tuple[Plan, Identity, dict[FlightKey, FlightRow]]:
    """Return the plan, the identity and the finished flights of a folder.

    Raises RunDirectoryError where it holds no sweep.
    """
    identity = _identity(folder)
    if identity is None:
        raise RunDirectoryError(folder, f"holds no sweep: no {IDENTITY}")
    axes = tuple(Axis(key, tuple(values)) for key, values in identity["vary"])
    rows: dict[FlightKey, FlightRow] = {}
    try:
        lines = (folder / LINES).read_bytes().splitlines(keepends=True)
    except OSError as error:
        raise RunDirectoryError(folder / LINES, error.strerror or str(error)) from error
    for row in map(_row, lines):
        if row is not None:
            rows.setdefault(FlightKey(row["cell"], row["seed"]), row)
    return Plan(axes, range(*identity["seeds"])), identity, rows


def is_sweep(folder: Path) -> bool:
    """Return whether a folder is one of a sweep."""
    return (folder / IDENTITY).is_file()


def _checked(folder: Path, identity: Identity) -> Any:
    """Return the identity that a folder holds, None for a new or empty folder.

    Raises RunDirectoryError where it holds anything but the same sweep.
    """
    if not folder.exists():
        return None
    before = _identity(folder)
    if before is None:
        if not folder.is_dir() or any(folder.iterdir()):
            raise RunDirectoryError(folder, "exists and holds no sweep; nothing is overwritten")
        return None
    now = _plain(identity)
    differing = [words for key, words in SAME.items() if before.get(key) != now[key]]
    if differing:
        raise RunDirectoryError(
            folder, f"holds another sweep (what differs: {', '.join(differing)}); {ANOTHER}"
        )
    (first, end), (now_first, now_end) = before["seeds"], now["seeds"]
    if first != now_first or end > now_end:
        detail = f"holds a sweep of the seeds {first}:{end}, which can only grow at the end"
        raise RunDirectoryError(folder, f"{detail}; {ANOTHER}")
    return before


def _identity(folder: Path) -> Any:
    """Return the content of sweep.json; None where there is none, or none that can be read."""
    try:
        content = json.loads((folder / IDENTITY).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return None
    return content if isinstance(content, dict) and content.get("schema") == SCHEMA else None


def _plain(identity: Identity) -> Any:
    """Return an identity as it is read back."""
    return json.loads(json.dumps(identity))


def _row(line: bytes) -> FlightRow | None:
    """Return the row of a line; None for one that was cut off."""
    try:
        row = json.loads(line)
    except ValueError:
        return None
    known = isinstance(row, dict) and FlightRow.__required_keys__ <= row.keys()
    return row if known and line.endswith(b"\n") else None
