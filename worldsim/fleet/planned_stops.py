"""Planned stops of netem's processes and of the world's, carried out by their parent."""

import os
import signal
import time
from collections.abc import Callable, Sequence
from typing import NamedTuple

from worldsim.fleet.ipc import LauncherToWorld, OtherProcessRequest, WorldWoken
from worldsim.fleet.process_table import ProcessTable
from worldsim.fleet.supervisor import Supervisor
from worldsim.judge.event import By

WORLD = "world"


class PlannedKill(NamedTuple):
    """A kill that was asked for."""

    by: By


class PlannedStops:
    """Carries out what the world requests.

    mediums: the names of netem's processes. start_medium: starts one of them anew, by its shard.
    """

    def __init__(
        self,
        supervisor: Supervisor,
        table: ProcessTable,
        world: LauncherToWorld,
        mediums: Sequence[str],
        start_medium: Callable[[int], None],
    ) -> None:
        self._supervisor, self._table, self._world = supervisor, table, world
        self._mediums, self._start_medium = mediums, start_medium
        self._killed: dict[str, list[By]] = {}
        """Who asked for the kills that are not seen yet, by process."""
        self._wake_at_s: float | None = None
        """When the world's pause is over [s; monotonic clock]; None: it is not paused."""

    def carry_out(self, request: OtherProcessRequest) -> None:
        """Kill, pause, resume or start netem's processes, or kill or pause the world."""
        names = self._mediums if request.process == "netem" else [WORLD]
        self._table.note_request(request.action, names)
        for shard, name in enumerate(names):
            if request.action == "start":
                self._start_medium(shard)
            elif name in self._supervisor.pids:
                self._strike(name, request)

    def take_kill(self, name: str) -> PlannedKill | None:
        """Return the planned kill that an exit of a process is, once for each; None: it is none."""
        asked_by = self._killed.get(name)
        return PlannedKill(asked_by.pop(0)) if asked_by else None

    def seconds_left(self, at_most_s: float) -> float:
        """Return how long to wait before ``wake_world`` has something to do [s]."""
        if self._wake_at_s is None:
            return at_most_s
        return min(at_most_s, max(0.0, self._wake_at_s - time.monotonic()))

    def wake_world(self) -> None:
        """End a pause of the world that has lasted as long as it was to."""
        if self._wake_at_s is None or time.monotonic() < self._wake_at_s:
            return
        self._wake_at_s = None
        self._table.note_request("resume", [WORLD])
        self._world.send(WorldWoken())
        if WORLD in self._supervisor.pids:
            self._supervisor.strike(WORLD, signal.SIGCONT, os.WCONTINUED)

    def _strike(self, name: str, request: OtherProcessRequest) -> None:
        match request.action:
            case "kill":
                self._killed.setdefault(name, []).append(request.by)
                self._supervisor.strike(name, signal.SIGKILL, os.WEXITED)
            case "pause":
                self._supervisor.strike(name, signal.SIGSTOP, os.WSTOPPED)
                if name == WORLD:
                    self._wake_at_s = time.monotonic() + request.for_s
            case _:
                self._supervisor.strike(name, signal.SIGCONT, os.WCONTINUED)
