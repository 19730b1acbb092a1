"""fleet.json: which processes a running fleet consists of, and where its router listens."""

import json
from pathlib import Path
from typing import NamedTuple

from netem.wire.keys import agent_name
from worldsim.results.run_folder import RunDirectoryError, write_json

FILE = "fleet.json"


class OperatorError(Exception):
    """A request to a fleet that came to nothing; one line that says why."""


class ProcessRow(NamedTuple):
    """One process of a fleet; not ``alive`` when it ended, whoever has its pid now."""

    name: str
    pid: int
    alive: bool


class ProcessTable:
    """Keeps a run's fleet.json while processes are started."""

    def __init__(self, folder: Path, run: str, endpoint: str) -> None:
        self._path = folder / FILE
        self._content = {"run": run, "endpoint": endpoint}
        self._processes: dict[str, tuple[int, int | None]] = {}
        self._paused: set[str] = set()

    def add(self, name: str, pid: int) -> None:
        """Note a process that was just started; it takes the place of an earlier one."""
        self._processes[name] = (pid, _started(pid))

    def note(self, deed: str, whom: list[tuple[int, int]]) -> None:
        """Note a deed on agents, (agent, incarnation) each: who is paused is meant to be."""
        names = {agent_name(agent) for agent, _ in whom}
        self._paused = self._paused | names if deed == "pause" else self._paused - names

    def stopped(self) -> str:
        """Return in words whose process is stopped though nobody planned that; "" for none."""
        names = [
            name
            for name, (pid, _) in self._processes.items()
            if name not in self._paused and _stat(pid)[:1] == ["T"]
        ]
        return f"; stopped: {', '.join(names)}" if names else ""

    def write(self) -> None:
        """Write the file. Raises RunDirectoryError when the disk fails."""
        rows = [
            {"name": name, "pid": pid, "started": started}
            for name, (pid, started) in self._processes.items()
        ]
        write_json(self._path, {**self._content, "processes": rows})


class Fleet(NamedTuple):
    """A fleet as fleet.json tells of it: the run's name, its router, its processes."""

    run: str
    endpoint: str
    processes: list[ProcessRow]


def fleet_of(run: Path) -> Fleet:
    """Return the fleet of the run in a folder, or raise RunDirectoryError."""
    path = run / FILE
    try:
        told = json.loads(path.read_text(encoding="utf-8"))
        rows = [ProcessRow(row["name"], row["pid"], _alive(row)) for row in told["processes"]]
        return Fleet(str(told["run"]), str(told["endpoint"]), rows)
    except OSError as error:
        raise RunDirectoryError(run, f"no {FILE} in it: no run of processes") from error
    except (ValueError, KeyError, TypeError) as error:
        raise RunDirectoryError(path, "cannot be read as a fleet's list of processes") from error


def processes(run: Path) -> list[ProcessRow]:
    """Return the processes of the run in a folder, or raise RunDirectoryError."""
    return fleet_of(run).processes


def _alive(row: dict[str, int]) -> bool:
    started = _started(row["pid"])
    return started is not None and started == row["started"]


def _started(pid: int) -> int | None:
    """Return when a process started [clock ticks since boot], None when it is not running.

    Pids come back; a pid with its start time does not.
    """
    state, *fields = _stat(pid) or ["X"]
    return None if state in "ZX" else int(fields[18])


def _stat(pid: int) -> list[str]:
    """Return what the kernel tells of a process, from its state on; nothing when it is gone."""
    try:
        stat = Path(f"/proc/{pid}/stat").read_text(encoding="ascii", errors="replace")
    except OSError:
        return []
    return stat.rpartition(")")[2].split()
