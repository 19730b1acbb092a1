"""A run in virtual time in a child process, as the process that watches it sees it.

A user's controller runs in the flight's process. It may end that process, block it, or eat its
memory: then the run fails, and the error names the agent whose code ran last.
"""

import json
import os
import signal
import time
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple

from worldsim.campaign import fresh_flight
from worldsim.campaign.flight import FLOWN, NOT_WRITTEN, FlightProbe, Kept, fly_in_child
from worldsim.campaign.printed import PrintedOutput
from worldsim.campaign.pulse import Place, Pulse, blame
from worldsim.fleet.fork import ProcessExit, fork, reap
from worldsim.results.outcome import Outcome
from worldsim.results.overall import FailedRun, Made, Result
from worldsim.results.run_folder import RunDirectory
from worldsim.results.summary import Summary
from worldsim.scenario.tables import Scenario

STEP_WITHIN_S = 10.0
"""Wall time that one step of an agent may last, its controller's decision included."""
STOPPED_STEP_WITHIN_S = 2.0
"""The same, once the run is asked to end."""
OWN_WORK_WITHIN_S = 120.0
"""Wall time that the program's own work may last between two steps."""
EXIT_WITHIN_S = 20.0
"""Wall time from the end of a flight to the end of its process."""
STACK_WITHIN_S = 0.3
MAX_POLL_S = 1.0
"""A longer pause between two checks is one of the host, and not counted."""


class Job(NamedTuple):
    """One run to make."""

    scenario: Scenario
    folder: Path | None  # a new folder; None: one named after the scenario and the time
    recording: bool
    trace: bool = False  # whether the trace is kept as a file
    probe: FlightProbe | None = None
    """Looks into the flight, in its process; without a recording."""


class WatchedFlight:
    """One flight, from its fork to its result. Raises RunDirectoryError without a folder."""

    def __init__(self, job: Job) -> None:
        self._scenario = job.scenario
        self._directory = RunDirectory.create(job.folder, job.scenario)
        self._pulse = Pulse()
        self.output = PrintedOutput(self._directory.path.name)
        kept = Kept(job.recording, job.trace, job.probe)
        self.pid = fork(self.output.write_end, signal.SIGKILL, lambda: self._fly(kept))
        self.output.release()
        self.exit_descriptor = os.pidfd_open(self.pid)
        self._exit: ProcessExit | None = None
        self._hung = ""
        self._cut_off = False
        self._before: tuple[Place, bool] | None = None
        self._checked_s = time.monotonic()
        self._still_s = 0.0

    @property
    def time_s(self) -> float:
        """How much was simulated so far [s]."""
        return self._pulse.place.slot / self._scenario.slot_hz

    def request_stop(self) -> None:
        """Ask the flight to end, with a summary of what was simulated."""
        self._pulse.request_stop()

    def check(self) -> bool:
        """Return whether the flight has ended; end it where it does not get on."""
        self._exit = self._exit or reap(self.pid)
        if self._exit is not None:
            return True
        now = self._pulse.place, self._pulse.ended
        if now != self._before or self._pulse.debugged:
            self._still_s, self._checked_s = 0.0, time.monotonic()
        self._before = now
        passed_s = time.monotonic() - self._checked_s
        self._checked_s += passed_s
        self._still_s += min(passed_s, MAX_POLL_S)
        if self._still_s > self._allowed_s() and not _stopped(self.pid):
            self._end_hung()
        return False

    def result(self) -> Made:
        """Return the summary, or the error that ended the flight, once it has ended."""
        self._close()
        error, details = self._pulse.error
        if self._exit == ProcessExit(None, FLOWN) and self._pulse.ended:
            summary: Summary = json.loads(self._directory.summary.read_text("utf-8"))
            return Result(self._directory.path, summary)
        name, seed = self._scenario.name, self._scenario.seed
        unwritten = self._exit == ProcessExit(None, NOT_WRITTEN) and self._pulse.ended
        outcome: Outcome = "inconclusive" if unwritten or self._cut_off else "fail"
        told = error or self._cause()
        return FailedRun(self._directory.path, name, seed, told, details, outcome, self._cut_off)

    def kill(self) -> None:
        """End the flight at once, whatever it does."""
        if self._exit is None:
            os.kill(self.pid, signal.SIGKILL)
            os.waitpid(self.pid, 0)
        self._close()

    def _fly(self, kept: Kept) -> int:
        folder = self._directory.path.absolute()  # a controller may change the current folder
        if kept.recording and fresh_flight.is_needed():
            fresh_flight.fly_in_fresh_child(self._scenario, folder, kept, self._pulse)
        return fly_in_child(self._scenario, RunDirectory(folder), kept, self._pulse)

    def _allowed_s(self) -> float:
        if self._pulse.ended:
            return EXIT_WITHIN_S
        if self._pulse.place.agent is None:
            return OWN_WORK_WITHIN_S
        return STOPPED_STEP_WITHIN_S if self._pulse.stop_requested else STEP_WITHIN_S

    def _end_hung(self) -> None:
        """Let the flight print where it is, and kill it.

        A step that it might have finished, had no stop been requested, is no failure.
        """
        self._hung = f"did not return within {self._allowed_s():g} s"
        self._cut_off = self._pulse.stop_requested and self._still_s <= STEP_WITHIN_S
        if not self._cut_off:
            os.kill(self.pid, signal.SIGUSR1)
            deadline = time.monotonic() + STACK_WITHIN_S
            while time.monotonic() < deadline:
                self.output.pass_on()
                time.sleep(0.05)
        with suppress(ProcessLookupError):
            os.kill(self.pid, signal.SIGKILL)

    def _cause(self) -> str:
        """Return what ended a flight that left no error."""
        place = self._pulse.place
        what = self._hung or f"its process {self._exit}"
        if place.agent is not None:
            return f"{blame(self._scenario, place.agent, place.slot)}: {what}"
        return f"the run failed at {self.time_s:g} s: {what}"

    def _close(self) -> None:
        if self.exit_descriptor >= 0:
            self.output.close()
            os.close(self.exit_descriptor)
            self._pulse.close()
            self.exit_descriptor = -1


def _stopped(pid: int) -> bool:
    """Return whether a process is stopped, by Ctrl-Z or a debugger."""
    stat = Path(f"/proc/{pid}/stat").read_text(encoding="ascii", errors="replace")
    return stat.rpartition(")")[2].split()[0] in "tT"
