"""One run in virtual time, as the child process that flies it sees it.

It writes into the run's folder, and reports its end, or the error that ended it, by its pulse.
"""

import faulthandler
import os
import pdb
import resource
import signal
import sys
import traceback
from contextlib import suppress
from pathlib import Path
from typing import Any, NamedTuple, Protocol

from agent.checked_controller import described
from agent.controller import FailedProgramError, FaultyControllerError
from netem.wire.shutdown import StopRequest
from worldsim.campaign.pulse import ClosedFilesError, Guard, Pulse, blame
from worldsim.engine.step import SlotLoop
from worldsim.engine.trace import TraceLog
from worldsim.engine.virtual import Flight, Probe, fly
from worldsim.fleet.fork import adopt_orphans, end_orphans
from worldsim.results.exit_status import INTERRUPTION
from worldsim.results.finished_run import FinishedRun
from worldsim.results.run_folder import RunDirectory, RunWriteError
from worldsim.results.sinks import Sinks, open_sinks
from worldsim.results.summary import summarise
from worldsim.results.trace_file import write_trace
from worldsim.scenario.tables import Scenario

MEMORY_B = 4 * 1024**3
"""What a run in virtual time may allocate, beside what it shares with others."""
MAX_TRACEBACK = 16_000
"""[characters]"""
FLOWN, FAILED, NOT_WRITTEN = 0, 1, 3
"""Exit statuses of a flight: a summary is there; an error ended it; no summary can be written."""


class FlightProbe(Probe, Protocol):
    """Looks into a flight, and writes what it saw."""

    def write(self, folder: Path) -> None:
        """Write into the folder of a flight that has ended by itself."""


class Kept(NamedTuple):
    """What a flight writes beside its events and its summary."""

    recording: bool
    trace: bool = False  # as a file, to be compared slot by slot
    probe: FlightProbe | None = None  # looks into the flight, in its process; not with a recording


def fly_in_child(scenario: Scenario, directory: RunDirectory, kept: Kept, pulse: Pulse) -> int:
    """Fly, and write recording, events and summary; return the exit status."""
    adopt_orphans()
    _limit_memory()
    _stop_when_debugged(pulse)
    faulthandler.enable(all_threads=False)
    faulthandler.register(signal.SIGUSR1, all_threads=False)
    try:
        _fly(scenario, directory, kept, pulse)
    except ClosedFilesError as error:
        pulse.note_end(str(error))
        os._exit(FAILED)
    except RunWriteError as error:
        path, reason = error.args
        pulse.note_end(f"{path.name}: {reason}")
        return NOT_WRITTEN
    except BaseException as error:  # noqa: BLE001, RUF100 - whatever it is, the parent is told
        _lift_memory_limit()
        _report(error, scenario, pulse)
        return FAILED
    pulse.note_end()
    return FLOWN


def finished(flight: Flight, scenario: Scenario) -> FinishedRun:
    """Return a flight in virtual time for its summary; no tick can be late there."""
    world = flight.loop.world
    return FinishedRun(
        mode="virtual",
        loop=flight.loop,
        medium_counters=flight.medium_counters,
        late_tick_fraction=0.0,
        real_time_factor=world.time_s / flight.wall_s,
        cut_off_by=(flight.ended_by or INTERRUPTION) if world.slot < scenario.slots else None,
    )


def _fly(scenario: Scenario, directory: RunDirectory, kept: Kept, pulse: Pulse) -> None:
    stop, log = StopRequest(), TraceLog() if kept.trace else None
    sinks = open_sinks(directory, scenario, directory.path.name, "virtual", kept.recording)
    try:
        flight = fly(
            scenario,
            sinks,
            should_stop=lambda: stop.requested or pulse.stop_requested,
            watch=Guard(pulse, scenario),
            log=log,
            probe=kept.probe,
        )
    except ClosedFilesError:
        raise
    except BaseException:
        _close(sinks)
        raise
    _close(sinks, flight.loop)
    flight.loop.note_writes()
    if log is not None:
        write_trace(log, directory.path)
    if kept.probe is not None:
        kept.probe.write(directory.path)
    directory.write_summary(summarise(scenario, finished(flight, scenario)))


def _close(sinks: Sinks, loop: SlotLoop | None = None) -> None:
    """Finish the recording; first end what controllers started, which would hold its file open.

    loop: of a run that ended; None: it broke off.
    """
    end_orphans(())
    if loop is None:
        sinks.close()
    else:
        sinks.close(loop.judge, loop.world.time_s)


def _report(error: BaseException, scenario: Scenario, pulse: Pulse) -> None:
    """Leave an error's line and its traceback in the pulse."""
    if isinstance(error, FailedProgramError):
        pulse.note_end(str(error), "")
        return
    if isinstance(error, FaultyControllerError):
        pulse.note_end(str(error), _traceback_of(error.__cause__ or error))
        return
    place = pulse.place
    where = (
        blame(scenario, place.agent, place.slot)
        if place.agent is not None
        else f"the run failed at {place.slot / scenario.slot_hz:g} s"
    )
    # What the host refuses is no error of this program's.
    refused = isinstance(error, OSError | MemoryError) and place.agent is None
    pulse.note_end(f"{where}: {described(error)}", "" if refused else _traceback_of(error))


def _traceback_of(error: BaseException) -> str:
    """Return a traceback; its end where it is very long."""
    return "".join(traceback.format_exception(error))[-MAX_TRACEBACK:]


def _limit_memory() -> None:
    """Let an allocation of MEMORY_B raise MemoryError, where the limit is not lower.

    What the process that flies holds from the start does not count.
    """
    _, hard = resource.getrlimit(resource.RLIMIT_DATA)
    most_b = _data_b() + MEMORY_B
    if hard == resource.RLIM_INFINITY or hard > most_b:
        resource.setrlimit(resource.RLIMIT_DATA, (most_b, hard))


def _data_b() -> int:
    """Return the size of what RLIMIT_DATA counts of this process [bytes]; 0 where it is unknown."""
    try:
        pages = Path("/proc/self/statm").read_text(encoding="ascii").split()[5]
    except OSError:
        return 0
    return int(pages) * resource.getpagesize()


def _lift_memory_limit() -> None:
    """Give back some memory, so that an error can be reported."""
    _, hard = resource.getrlimit(resource.RLIMIT_DATA)
    with suppress(OSError, ValueError):
        resource.setrlimit(resource.RLIMIT_DATA, (hard, hard))


def _stop_when_debugged(pulse: Pulse) -> None:
    """Tell the watching process when a breakpoint() is hit."""
    hook = sys.breakpointhook

    def breakpoint_hit(*arguments: Any, **keywords: Any) -> Any:
        pulse.note_breakpoint()
        if hook is not sys.__breakpointhook__ or os.environ.get("PYTHONBREAKPOINT"):
            return hook(*arguments, **keywords)
        # Python's own hook would stop in this function.
        return pdb.Pdb().set_trace(sys._getframe(1))

    sys.breakpointhook = breakpoint_hit
