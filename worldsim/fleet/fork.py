"""Forked children: they die with their parent, and what they print goes to their log.

Everything is forked from a process that has opened no Zenoh session and no recording; after
either, a child would hang.
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

ENDING = frozenset({signal.SIGINT, signal.SIGHUP, signal.SIGTERM})
_PR_SET_PDEATHSIG = 1


class Exit(NamedTuple):
    """How a child ended: by a signal, or with a status."""

    signal: int | None
    status: int | None

    @staticmethod
    def of(wait_status: int) -> "Exit":
        """Return what waitpid's status says."""
        if os.WIFSIGNALED(wait_status):
            return Exit(os.WTERMSIG(wait_status), None)
        return Exit(None, os.waitstatus_to_exitcode(wait_status))

    def __str__(self) -> str:
        if self.signal is not None:
            return f"was killed by signal {self.signal}"
        return f"ended with status {self.status}"


class Log(io.RawIOBase):
    """Descriptor 1, the log, and what the parent has for stderr where the log takes no more.

    On a full disk the recording's end must still be said, and saying so must stop nobody.
    """

    def __init__(self, otherwise: int) -> None:
        self._otherwise = otherwise

    def writable(self) -> bool:
        """Say that it is."""
        return True

    def write(self, data: Any, /) -> int:
        """Write to the log, or else to the other; what neither takes is lost."""
        try:
            return os.write(1, data)
        except OSError:
            # A terminal that is gone as well leaves nobody to tell.
            with suppress(OSError):
                os.write(self._otherwise, data)
            return len(data)


def fork(log: Path | None, death_signal: signal.Signals, main: Callable[[], int]) -> int:
    """Run ``main`` in a child that gets ``death_signal`` when this process dies; return its pid.

    ``log``: where its output goes; None leaves it where this process's goes.
    """
    parent = os.getpid()
    sys.stdout.flush()
    sys.stderr.flush()
    # Until it has handlers of its own, a child that is ended would run its parent's.
    before = signal.pthread_sigmask(signal.SIG_BLOCK, ENDING)
    try:
        pid = os.fork()
        if pid == 0:
            _live(parent, log, death_signal, main)
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
    return pid


def reaped(pid: int) -> Exit | None:
    """Return how a child ended, or None while it lives."""
    done, wait_status = os.waitpid(pid, os.WNOHANG)
    return Exit.of(wait_status) if done else None


def _live(
    parent: int, log: Path | None, death_signal: signal.Signals, main: Callable[[], int]
) -> None:
    status = 1
    try:
        # Ctrl-C, or the terminal's end, reaches the whole group; the launcher conducts the end.
        signal.signal(signal.SIGINT, signal.SIG_IGN)
        signal.signal(signal.SIGHUP, signal.SIG_IGN)
        signal.signal(signal.SIGTERM, signal.SIG_DFL)
        signal.pthread_sigmask(signal.SIG_UNBLOCK, ENDING)
        _follow(parent, death_signal)
        _redirect(log)
        status = main()
    except SystemExit as leaving:
        status = leaving.code if isinstance(leaving.code, int) else 1
    except BaseException:  # noqa: BLE001, RUF100 - a child must never return into its parent's code
        traceback.print_exc()
    finally:
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(status)


def _follow(parent: int, death_signal: signal.Signals) -> None:
    """Ask for a signal at the parent's death; leave at once where it has died meanwhile."""
    libc = ctypes.CDLL(None, use_errno=True)
    if libc.prctl(_PR_SET_PDEATHSIG, int(death_signal), 0, 0, 0) != 0:
        raise OSError(ctypes.get_errno(), "prctl(PR_SET_PDEATHSIG)")
    if os.getppid() != parent:
        os._exit(1)


def _redirect(log: Path | None) -> None:
    """Read nothing, and write to the log, whatever the parent made of its own streams."""
    _replace(0, os.open(os.devnull, os.O_RDONLY))
    if log is None:
        sys.stdout = os.fdopen(1, "w", buffering=1, closefd=False)
        sys.stderr = os.fdopen(2, "w", buffering=1, closefd=False)
        return
    otherwise = os.dup(2)
    _replace(1, os.open(log, os.O_WRONLY | os.O_CREAT | os.O_APPEND, 0o644))
    os.dup2(1, 2)
    written = io.BufferedWriter(Log(otherwise))
    sys.stdout = sys.stderr = io.TextIOWrapper(written, encoding="utf-8", line_buffering=True)


def _replace(descriptor: int, other: int) -> None:
    os.dup2(other, descriptor)
    os.close(other)
