"""The launcher's own child processes: forked, watched, reaped and ended."""

import os
import selectors
import signal
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from worldsim.fleet.fork import ProcessExit, fork, reap
from worldsim.fleet.ipc import MessageSocket

Callback = Callable[[], None]


class Supervisor:
    """Named child processes and the sockets to them; ``poll`` runs the callbacks of both.

    ``on_exit`` is called with the name of a child that ended, and its exit.
    """

    def __init__(self, logs: Path, on_exit: Callable[[str, ProcessExit], None]) -> None:
        self.pids: dict[str, int] = {}
        self._logs = logs
        self._on_exit = on_exit
        self._selector = selectors.DefaultSelector()

    def start(self, name: str, death_signal: signal.Signals, main: Callable[[], int]) -> int:
        """Fork a child that writes to its log in the run's folder; return its pid."""
        pid = fork(self._logs / f"{name}.log", death_signal, main)
        self.pids[name] = pid
        exit_descriptor = os.pidfd_open(pid)
        self._selector.register(
            exit_descriptor, selectors.EVENT_READ, lambda: self._reap(exit_descriptor, name, pid)
        )
        return pid

    def watch(self, messages: MessageSocket[Any, Any], on_readable: Callback) -> None:
        """Call ``on_readable`` whenever messages have arrived, until the socket is closed."""

        def read() -> None:
            on_readable()
            if messages.closed:
                self._selector.unregister(messages)

        self._selector.register(messages, selectors.EVENT_READ, read)

    def poll(self, timeout_s: float) -> None:
        """Run the callbacks of what has happened, or happens within ``timeout_s`` [s]."""
        for key, _ in self._selector.select(timeout_s):
            callback: Callback = key.data
            callback()

    def end(self, names: list[str], within_s: float, number: signal.Signals | None) -> bool:
        """Wait until these children have ended, after a signal if one is given.

        A child that is stopped continues first, to handle the signal.

        Returns whether all of them have ended within ``within_s`` [s].
        """
        for name in names:
            if number is not None and name in self.pids:
                os.kill(self.pids[name], number)
                os.kill(self.pids[name], signal.SIGCONT)
        deadline = time.monotonic() + within_s
        while any(name in self.pids for name in names):
            left_s = deadline - time.monotonic()
            if left_s <= 0.0:
                return False
            self.poll(left_s)
        return True

    def strike(self, name: str, number: signal.Signals, awaited: int) -> None:
        """Signal a child, and wait for the state that waitid calls ``awaited``."""
        pid = self.pids[name]
        os.kill(pid, number)
        os.waitid(os.P_PID, pid, awaited | os.WEXITED | os.WNOWAIT)

    def _reap(self, exit_descriptor: int, name: str, pid: int) -> None:
        process_exit = reap(pid)
        if process_exit is None:
            return
        self._selector.unregister(exit_descriptor)
        os.close(exit_descriptor)
        if self.pids.get(name) == pid:  # a killed process may have been replaced already
            del self.pids[name]
        self._on_exit(name, process_exit)
