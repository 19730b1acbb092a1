"""The launcher's own children: forked, watched, reaped, ended."""

import os
import selectors
import signal
import time
from collections.abc import Callable
from pathlib import Path

from worldsim.fleet.fork import Exit, fork, reaped
from worldsim.fleet.ipc import MessageSocket

Act = Callable[[], None]


class Supervisor:
    """Named children and the lines to them: what happens on either is acted upon in ``turn``.

    ``on_exit`` hears the name of a child that ended, and how.
    """

    def __init__(self, logs: Path, on_exit: Callable[[str, Exit], None]) -> None:
        self.pids: dict[str, int] = {}
        self._logs = logs
        self._on_exit = on_exit
        self._watch = selectors.DefaultSelector()

    def start(self, name: str, death_signal: signal.Signals, main: Callable[[], int]) -> int:
        """Fork a child that writes to its log in the run's folder; return its pid."""
        pid = fork(self._logs / f"{name}.log", death_signal, main)
        self.pids[name] = pid
        exit_descriptor = os.pidfd_open(pid)
        self._watch.register(
            exit_descriptor, selectors.EVENT_READ, lambda: self._bury(exit_descriptor, name)
        )
        return pid

    def listen(self, lines: MessageSocket, hear: Act) -> None:
        """Call ``hear`` whenever something comes in on ``lines``, until they are closed."""

        def act() -> None:
            hear()
            if lines.closed:
                self._watch.unregister(lines)

        self._watch.register(lines, selectors.EVENT_READ, act)

    def turn(self, timeout_s: float) -> None:
        """Act on what has happened, or happens within ``timeout_s`` [s]."""
        for key, _ in self._watch.select(timeout_s):
            act: Act = key.data
            act()

    def end(self, names: list[str], within_s: float, number: signal.Signals | None) -> bool:
        """Wait until these have ended, after a signal if one is given; say whether they have."""
        for name in names:
            if number is not None and name in self.pids:
                os.kill(self.pids[name], number)
        deadline = time.monotonic() + within_s
        while any(name in self.pids for name in names):
            left_s = deadline - time.monotonic()
            if left_s <= 0.0:
                return False
            self.turn(left_s)
        return True

    def _bury(self, exit_descriptor: int, name: str) -> None:
        end = reaped(self.pids[name])
        if end is None:
            return
        self._watch.unregister(exit_descriptor)
        os.close(exit_descriptor)
        del self.pids[name]
        self._on_exit(name, end)
