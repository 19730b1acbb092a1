"""How long the steps of a fleet's agents last, in memory that all processes of a run share.

Each agent writes its own row. A reader of it knows whether the agent's code, its controller
included, has returned: an agent that hangs cannot say so itself.
"""

import fcntl
import mmap
import os
import resource
import time
from typing import NamedTuple

CLOSED_FILES = 5
"""Exit status of an agent whose controller closed the files of its process."""

_PID, _ENTERED, _CPU, _SLOW, _SLOW_US = range(5)
_NUMBERS = 8
_US = 1_000_000


class StepTimes(NamedTuple):
    """What one agent's process wrote."""

    pid: int  # 0: it has not started
    entered_s: float | None  # when its present step began [s; monotonic clock]; None: in no step
    cpu_s: float  # CPU time of the process when that step began [s]
    slow_steps: int  # number of steps that took over half a tick by their own doing
    slow_s: float  # wall time of these in total [s]


class StepPage:
    """Rows for all agents. Make it before the agents' processes are forked."""

    def __init__(self, agents: int) -> None:
        self._page = mmap.mmap(-1, max(1, agents) * _NUMBERS * 8)
        self._numbers = memoryview(self._page).cast("q")

    def row(self, agent: int) -> "memoryview[int]":
        """Return the row that an agent writes."""
        return self._numbers[agent * _NUMBERS : (agent + 1) * _NUMBERS]

    def note_pid(self, agent: int, pid: int) -> None:
        """Note the process of a row that is written by nobody else."""
        self.row(agent)[_PID] = pid

    def note_step(self, agent: int, cpu_s: float | None) -> None:
        """Note for an agent that writes no row that its step begins; None: that it is over.

        cpu_s: CPU time of its process so far [s].
        """
        row = self.row(agent)
        row[_CPU] = 0 if cpu_s is None else round(cpu_s * _US)
        row[_ENTERED] = 0 if cpu_s is None else round(time.monotonic() * _US)

    def read(self, agent: int) -> StepTimes:
        """Return what an agent wrote."""
        row = self.row(agent)
        entered_s = row[_ENTERED] / _US if row[_ENTERED] else None
        return StepTimes(row[_PID], entered_s, row[_CPU] / _US, row[_SLOW], row[_SLOW_US] / _US)


class StepGuard:
    """Notes an agent's steps in its row, and what a step does to its process.

    row: None where nobody reads it. tick_s: [s; wall time].
    """

    def __init__(self, row: "memoryview[int] | None", tick_s: float) -> None:
        self._row = row
        self._half_tick_s = 0.5 * tick_s
        self._pid = os.getpid()
        self._sentinel = os.open(os.devnull, os.O_RDONLY)
        self._usage = _usage()
        self._entered_s = 0.0
        if row is not None:
            row[:] = memoryview(bytes(8 * _NUMBERS)).cast("q")
            row[_PID] = self._pid

    def enter(self) -> None:
        """Note that a step begins."""
        self._usage, self._entered_s = _usage(), time.monotonic()
        if self._row is not None:
            self._row[_CPU] = round(time.process_time() * _US)
            self._row[_ENTERED] = round(self._entered_s * _US)

    def leave(self) -> None:
        """Note that it has returned.

        A copy of this process that a controller has forked ends here, and so does a process whose
        files are closed: it can neither command nor report.
        """
        if os.getpid() != self._pid:
            os._exit(1)
        try:
            fcntl.fcntl(self._sentinel, fcntl.F_GETFD)
        except OSError:
            os._exit(CLOSED_FILES)
        if self._row is not None:
            self._row[_ENTERED] = 0
            self._note_slow(time.monotonic() - self._entered_s)

    def _note_slow(self, lasted_s: float) -> None:
        """Count a long step that computed or waited; one that only waited for a core is not."""
        if lasted_s <= self._half_tick_s or self._row is None:
            return
        cpu_s, waits = (now - then for now, then in zip(_usage(), self._usage, strict=True))
        if cpu_s > self._half_tick_s or waits:
            self._row[_SLOW] += 1
            self._row[_SLOW_US] += round(lasted_s * _US)


def _usage() -> tuple[float, int]:
    """Return this thread's CPU time [s], and how often it has waited by itself."""
    usage = resource.getrusage(resource.RUSAGE_THREAD)
    return usage.ru_utime + usage.ru_stime, usage.ru_nvcsw
