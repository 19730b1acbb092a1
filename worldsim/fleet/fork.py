"""Forked child processes: they die with their parent, and so does what they fork.

The forking process must not have opened a Zenoh session: after that, a child hangs.
"""

import ctypes
import os
import signal
import traceback
from collections.abc import Callable, Collection
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple

from worldsim.fleet.child_output import finish_output, flush_output, redirect_output

END_SIGNALS = frozenset({signal.SIGINT, signal.SIGHUP, signal.SIGTERM})
_PR_SET_PDEATHSIG = 1
_PR_SET_CHILD_SUBREAPER = 36
_prctl_of_libc = ctypes.CDLL(None, use_errno=True).prctl
"""Looked up once: a look-up makes a class, in every child on memory pages of its own."""


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


def fork(output: Path | int | None, death_signal: signal.Signals, main: Callable[[], int]) -> int:
    """Run ``main`` in a child that gets ``death_signal`` when this process dies; return its pid.

    The child's output goes to ``output``, a log file or an open descriptor; with None it goes where
    this process's output goes. Its input is /dev/null, and this process's with a descriptor. What
    the child forks in turn ends with the child.
    """
    parent = os.getpid()
    flush_output()
    # A signal that arrives before the child has its own handlers would run the parent's.
    previous = signal.pthread_sigmask(signal.SIG_BLOCK, END_SIGNALS)
    try:
        pid = os.fork()
        if pid == 0:
            _run_child(parent, output, death_signal, main)
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, previous)
    return pid


def reap(pid: int) -> ProcessExit | None:
    """Reap a child and return its exit, or None while it runs."""
    reaped_pid, wait_status = os.waitpid(pid, os.WNOHANG)
    return ProcessExit.of(wait_status) if reaped_pid else None


def _run_child(
    parent: int, output: Path | int | None, death_signal: signal.Signals, main: Callable[[], int]
) -> None:
    status = 1
    try:
        # Ctrl-C and a closed terminal signal the whole group; the launcher ends the children.
        signal.signal(signal.SIGINT, signal.SIG_IGN)
        signal.signal(signal.SIGHUP, signal.SIG_IGN)
        signal.signal(signal.SIGTERM, signal.SIG_DFL)
        signal.pthread_sigmask(signal.SIG_UNBLOCK, END_SIGNALS)
        request_death_signal(parent, death_signal)
        os.register_at_fork(
            before=_remember_own_pid,
            after_in_child=lambda: request_death_signal(_own_pid[0], signal.SIGKILL),
        )
        redirect_output(output)
        status = main()
    except SystemExit as leaving:
        status = leaving.code if isinstance(leaving.code, int) else 1
    except BaseException:  # noqa: BLE001, RUF100 - a child must never return into its parent's code
        # The descriptors may be closed by now.
        with suppress(Exception):
            traceback.print_exc()
    finally:
        finish_output()
        os._exit(status)


_own_pid = [0]
"""The process that forks, as its child sees it."""


def _remember_own_pid() -> None:
    _own_pid[0] = os.getpid()


def request_death_signal(parent: int, death_signal: signal.Signals) -> None:
    """Request a signal at the parent's death; exit at once if the parent has already died."""
    _prctl(_PR_SET_PDEATHSIG, int(death_signal), "PR_SET_PDEATHSIG")
    if os.getppid() != parent:
        os._exit(1)


def adopt_orphans(adopt: bool = True) -> None:
    """Let this process become the parent of descendants whose own parent ends, or no longer."""
    _prctl(_PR_SET_CHILD_SUBREAPER, int(adopt), "PR_SET_CHILD_SUBREAPER")


def children() -> set[int]:
    """Return the pids of this process's children, adopted ones and zombies included."""
    own = os.getpid()
    found = set()
    for entry in Path("/proc").iterdir():
        if entry.name.isdecimal() and _parent_of(int(entry.name)) == own:
            found.add(int(entry.name))
    return found


def end_orphans(known: Collection[int]) -> int:
    """Kill and reap every child that is not ``known``, and what it started; return how many."""
    ended = 0
    while orphans := children().difference(known):
        for pid in orphans:
            with suppress(ProcessLookupError):
                os.kill(pid, signal.SIGKILL)
            with suppress(ChildProcessError):
                os.waitpid(pid, 0)
        ended += len(orphans)
    return ended


def _parent_of(pid: int) -> int | None:
    try:
        stat = Path(f"/proc/{pid}/stat").read_text(encoding="ascii", errors="replace")
    except OSError:
        return None
    return int(stat.rpartition(")")[2].split()[1])


def _prctl(option: int, value: int, name: str) -> None:
    if _prctl_of_libc(option, value, 0, 0, 0) != 0:
        raise OSError(ctypes.get_errno(), f"prctl({name})")
