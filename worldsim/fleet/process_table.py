"""fleet.json: the processes of a running fleet, and the endpoint of its router."""

from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path
from typing import Annotated, NamedTuple, assert_never

import msgspec
from msgspec import Meta

from netem.wire.keys import agent_name
from worldsim.fleet.ipc import AgentProcess, Pid, ProcessAction
from worldsim.results.run_folder import USERS, RunDirectoryError, write_json

FILE = "fleet.json"


class OperatorError(Exception):
    """A request to a running fleet that failed; the text is one line with the reason."""


class ProcessEntry(msgspec.Struct, frozen=True):
    """A process as fleet.json holds it.

    A pid can be reused, but not together with its start time.
    """

    name: str
    pid: Pid
    started: Annotated[int, Meta(ge=0)] | None  # [clock ticks since boot]; None: ended at once


class FleetFile(msgspec.Struct, frozen=True):
    """The content of fleet.json."""

    run: str
    endpoint: str
    processes: tuple[ProcessEntry, ...]


class ProcessRow(NamedTuple):
    """A process of a fleet, and whether it is still running."""

    name: str
    pid: int
    alive: bool


class Fleet(NamedTuple):
    """A fleet as its fleet.json describes it."""

    run: str
    endpoint: str
    processes: list[ProcessRow]


class ProcessTable:
    """Maintains a run's fleet.json while processes are started."""

    def __init__(self, folder: Path, run: str, endpoint: str) -> None:
        self._path = folder / FILE
        self._run = run
        self._endpoint = endpoint
        self._entries: dict[str, ProcessEntry] = {}
        self._paused: set[str] = set()

    def add(self, name: str, pid: int) -> None:
        """Add a process that was just started; it replaces an earlier one of the same name."""
        self._entries[name] = ProcessEntry(name, pid, _start_time(pid))

    def note_action(self, action: ProcessAction, processes: Iterable[AgentProcess]) -> None:
        """Note a requested action: a requested pause is not reported as stopped."""
        self.note_request(action, [agent_name(process.agent) for process in processes])

    def note_request(self, action: ProcessAction, names: Iterable[str]) -> None:
        """Note a requested action on the processes of some names."""
        match action:
            case "pause":
                self._paused.update(names)
            case "start" | "kill" | "resume":
                self._paused.difference_update(names)
            case _:
                assert_never(action)

    def stopped(self) -> list[str]:
        """Return the names of the processes that are stopped without a requested pause."""
        return [
            entry.name
            for entry in self._entries.values()
            if entry.name not in self._paused and _stat(entry.pid)[:1] == ["T"]
        ]

    def write(self) -> None:
        """Write the file. Raises RunWriteError when the disk fails."""
        content = FleetFile(self._run, self._endpoint, tuple(self._entries.values()))
        write_json(self._path, msgspec.to_builtins(content))


def read_fleet(run: Path) -> Fleet:
    """Return the fleet of the run in a folder.

    Raises RunDirectoryError when the folder has no fleet.json, or one that is not valid.
    """
    path = run / FILE
    try:
        content = msgspec.json.decode(path.read_bytes(), type=FleetFile)
    except OSError as error:
        detail = f"not a process run (no {FILE})" if run.is_dir() else "no such folder"
        raise RunDirectoryError(run, detail) from error
    except (msgspec.DecodeError, UnicodeDecodeError, RecursionError) as error:
        raise RunDirectoryError(path, f"not a valid {FILE}: {error}") from error
    rows = [ProcessRow(entry.name, entry.pid, _alive(entry)) for entry in content.processes]
    return Fleet(content.run, content.endpoint, rows)


def processes(run: Path) -> list[ProcessRow]:
    """Return the processes of the run in a folder. Raises RunDirectoryError as read_fleet."""
    return read_fleet(run).processes


def sweep_passwords(folder: Path) -> None:
    """Delete the passwords that killed launchers have left in the runs of a folder.

    A run whose processes are not all gone, or whose fleet.json cannot be read, is left alone.
    """
    for users in folder.glob(f"*/{USERS}"):
        try:
            alive = any(row.alive for row in processes(users.parent))
        except RunDirectoryError:
            continue
        if not alive:
            # Another start may sweep at the same time, or the folder may be read-only.
            with suppress(OSError):
                users.unlink()


def _alive(entry: ProcessEntry) -> bool:
    started = _start_time(entry.pid)
    return started is not None and started == entry.started


def _start_time(pid: int) -> int | None:
    """Return when a process started [clock ticks since boot], None when it is not running."""
    state, *fields = _stat(pid) or ["X"]
    return None if state in "ZX" else int(fields[18])


def _stat(pid: int) -> list[str]:
    """Return the fields of /proc/<pid>/stat from the state on; none when the process is gone."""
    try:
        stat = Path(f"/proc/{pid}/stat").read_text(encoding="ascii", errors="replace")
    except OSError:
        return []
    return stat.rpartition(")")[2].split()
