"""Forked child processes: they die with their parent, and their output goes to their log.

The forking process must not have opened a Zenoh session or a recording: after either, a child
hangs.
"""

import ctypes
import io
import os
import signal
import sys
import traceback
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any, NamedTuple

END_SIGNALS = frozenset({signal.SIGINT, signal.SIGHUP, signal.SIGTERM})
_PR_SET_PDEATHSIG = 1


class ProcessExit(NamedTuple):
    """How a process ended: by a signal or with a status; neither where that is unknown."""

    signal: int | None
    status: int | None

    @staticmethod
    def of(wait_status: int) -> "ProcessExit":
        """Return the exit that waitpid's status encodes."""
        if os.WIFSIGNALED(wait_status):
            return ProcessExit(os.WTERMSIG(wait_status), None)
        return ProcessExit(None, os.waitstatus_to_exitcode(wait_status))

    def __str__(self) -> str:
        if self.signal is not None:
            return f"was killed by signal {self.signal}"
        return "ended" if self.status is None else f"ended with status {self.status}"


class LogStream(io.RawIOBase):
    """Writes to descriptor 1, the log, or to a fallback when the log cannot be written.

    On a full disk the end of the recording must still be reported, and a failed report must not
    end the process.
    """

    def __init__(self, fallback: int) -> None:
        self._fallback = fallback

    def writable(self) -> bool:
        """Return True."""
        return True

    def write(self, data: Any, /) -> int:
        """Write to the log, else to the fallback; data that neither accepts is lost."""
        try:
            return os.write(1, data)
        except OSError:
            # The fallback is the terminal; when it is gone as well, no reader is left.
            with suppress(OSError):
                os.write(self._fallback, data)
            return len(data)


def fork(log: Path | None, death_signal: signal.Signals, main: Callable[[], int]) -> int:
    """Run ``main`` in a child that gets ``death_signal`` when this process dies; return its pid.

    The child's output goes to ``log``; with None it goes where this process's output goes.
    """
    parent = os.getpid()
    sys.stdout.flush()
    sys.stderr.flush()
    # A signal that arrives before the child has its own handlers would run the parent's.
    previous = signal.pthread_sigmask(signal.SIG_BLOCK, END_SIGNALS)
    try:
        pid = os.fork()
        if pid == 0:
            _run_child(parent, log, death_signal, main)
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, previous)
    return pid


def reap(pid: int) -> ProcessExit | None:
    """Reap a child and return its exit, or None while it runs."""
    reaped_pid, wait_status = os.waitpid(pid, os.WNOHANG)
    return ProcessExit.of(wait_status) if reaped_pid else None


def _run_child(
    parent: int, log: Path | None, death_signal: signal.Signals, main: Callable[[], int]
) -> None:
    status = 1
    try:
        # Ctrl-C and a closed terminal signal the whole group; the launcher ends the children.
        signal.signal(signal.SIGINT, signal.SIG_IGN)
        signal.signal(signal.SIGHUP, signal.SIG_IGN)
        signal.signal(signal.SIGTERM, signal.SIG_DFL)
        signal.pthread_sigmask(signal.SIG_UNBLOCK, END_SIGNALS)
        _request_death_signal(parent, death_signal)
        _redirect_output(log)
        status = main()
    except SystemExit as leaving:
        status = leaving.code if isinstance(leaving.code, int) else 1
    except BaseException:  # noqa: BLE001, RUF100 - a child must never return into its parent's code
        traceback.print_exc()
    finally:
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(status)


def _request_death_signal(parent: int, death_signal: signal.Signals) -> None:
    """Request a signal at the parent's death; exit at once if the parent has already died."""
    libc = ctypes.CDLL(None, use_errno=True)
    if libc.prctl(_PR_SET_PDEATHSIG, int(death_signal), 0, 0, 0) != 0:
        raise OSError(ctypes.get_errno(), "prctl(PR_SET_PDEATHSIG)")
    if os.getppid() != parent:
        os._exit(1)


def _redirect_output(log: Path | None) -> None:
    """Read from /dev/null and write to the log, whatever the parent's streams are."""
    _replace(0, os.open(os.devnull, os.O_RDONLY))
    if log is None:
        sys.stdout = os.fdopen(1, "w", buffering=1, closefd=False)
        sys.stderr = os.fdopen(2, "w", buffering=1, closefd=False)
        return
    fallback = os.dup(2)
    _replace(1, os.open(log, os.O_WRONLY | os.O_CREAT | os.O_APPEND, 0o644))
    os.dup2(1, 2)
    buffered = io.BufferedWriter(LogStream(fallback))
    sys.stdout = sys.stderr = io.TextIOWrapper(buffered, encoding="utf-8", line_buffering=True)


def _replace(descriptor: int, replacement: int) -> None:
    os.dup2(replacement, descriptor)
    os.close(replacement)
