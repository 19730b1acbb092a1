"""The world as a process: it waits for a fleet of real processes, runs it, and judges it."""

import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import msgspec
import zenoh

from agent.checked_controller import described
from netem.messages import MediumCounters
from netem.wire.access import AccessError, login_of
from netem.wire.bus import Bus
from netem.wire.keys import Keys
from netem.wire.session import SessionError, open_client
from netem.wire.shutdown import StopRequest
from worldsim.engine.trace import TraceLog
from worldsim.fleet.free_running import FreeRunningFleet
from worldsim.fleet.launcher_link import LauncherLink
from worldsim.fleet.lockstep import LockstepFleet
from worldsim.fleet.overload import OnOverload, Overload
from worldsim.fleet.startup import Startup, StartupError, assemble
from worldsim.results.exit_status import BAD_INPUT, EXIT_STATUS, INCONCLUSIVE
from worldsim.results.finished_run import FinishedRun, Mode
from worldsim.results.run_folder import RunDirectory, RunDirectoryError, RunWriteError
from worldsim.results.sinks import Sinks, open_sinks
from worldsim.results.summary import Summary, summarise
from worldsim.results.trace_file import write_trace
from worldsim.scenario.tables import Scenario


class RunOptions(NamedTuple):
    """The options of a run that are not part of its scenario."""

    run: str  # name of the run
    speed: float = 1.0  # simulated seconds in one second of wall time; without effect in lockstep
    recording: bool = True  # whether run.rrd is written
    lockstep: bool = False  # simulated time waits for every process
    shards: int = 1  # number of mediums that share the agents
    users: Path | None = None  # file of passwords, where the router requires one
    on_overload: OnOverload = "go"  # what is done when ticks are late; not in lockstep
    trace: bool = False  # whether the trace is kept as a file; in lockstep alone
    inputs: bool = False  # whether agents keep all that they are given
    launched_s: float | None = None  # when the launcher started [s; monotonic clock], if one did

    @property
    def mode(self) -> Mode:
        """The clock's name in the summary."""
        return "lockstep" if self.lockstep else "processes"


def run(
    connect: str,
    scenario: Scenario,
    directory: Callable[[], RunDirectory],
    options: RunOptions,
    link_of: Callable[[Startup], LauncherLink],
) -> int:
    """Run the world at a router; print an error in one line; return the exit status.

    ``directory`` is called once the router answers: without a router, no folder is made.
    """
    try:
        login = login_of(options.users, "world") if options.users is not None else None
        with open_client(connect, login=login) as session:
            return conduct(session, scenario, directory(), options, link_of)
    except (AccessError, SessionError, StartupError, RunDirectoryError) as error:
        print(f"world: {error}", file=sys.stderr)
        return INCONCLUSIVE if isinstance(error, RunWriteError) else BAD_INPUT


def conduct(
    session: zenoh.Session,
    scenario: Scenario,
    directory: RunDirectory,
    options: RunOptions,
    link_of: Callable[[Startup], LauncherLink],
) -> int:
    """Wait for a fleet, run it and judge it; return the exit status of the contract.

    Raises StartupError when a process does not start. However the run ends, by SIGTERM or by an
    error of this program, the recording is finished and a summary of the part that was run is
    written; if the run never began, neither is kept.
    """
    stop = StopRequest()
    bus = Bus(session, Keys(options.run))
    bus.declare_alive("world")
    startup = Startup(bus, scenario, options.lockstep, options.shards)
    launcher = link_of(startup)
    directory.on_loss = launcher.report_notice
    sinks = open_sinks(directory, scenario, directory.path.name, options.mode, options.recording)
    fleet = _fleet(scenario, bus, sinks, launcher, startup, options)
    complete, up_s, failure = False, None, ""

    def should_stop() -> bool:
        return stop.requested or launcher.stop_reason is not None

    try:
        present = assemble(startup, options.speed, should_stop, launcher)
        up_s = time.monotonic()
        complete = present and fleet.fly(should_stop)
    except Exception as error:
        failure = _failure(error, directory)
        raise
    finally:
        fleet.land()
        sinks.close(fleet.loop.judge if complete else None, fleet.loop.world.time_s)
        fleet.loop.note_writes()
        launcher.wait(0.0)  # reads the reason that the launcher sends before its SIGTERM
        cause = launcher.stop_reason or failure or fleet.ended_by or "interrupted"
        ended_by = None if complete else cause
        summary = summarise(scenario, _finished(fleet, options, ended_by, up_s))
        if fleet.begun:
            summary = _write(summary, fleet.loop.trace.log, directory)
        else:
            directory.remove_results()
    if launcher.orphaned:
        directory.users.unlink(missing_ok=True)
    outcome = summary["outcome"] if fleet.begun else f"{ended_by} before take-off"
    print(f"world: {outcome}{_lateness(fleet.medium_counters)}", flush=True)
    return EXIT_STATUS[summary["outcome"]]


def _write(summary: Summary, log: TraceLog | None, directory: RunDirectory) -> Summary:
    """Write the summary, and the trace if it is kept. Raises RunWriteError."""
    try:
        if log is not None:
            write_trace(log, directory.path)
    except OSError as error:
        raise RunWriteError(directory.path, error.strerror or str(error)) from error
    return directory.write_summary(summary)


def _failure(error: Exception, directory: RunDirectory) -> str:
    """Return what a summary says of an error that ends the world."""
    log = directory.logs / "world.log"
    where = f" ({log.relative_to(directory.path)})" if log.exists() else ""
    return f"the world failed: {described(error)}{where}"


def _fleet(
    scenario: Scenario,
    bus: Bus,
    sinks: Sinks,
    launcher: LauncherLink,
    startup: Startup,
    options: RunOptions,
) -> FreeRunningFleet | LockstepFleet:
    if options.lockstep:
        fleet = LockstepFleet(scenario, bus, sinks, launcher, startup, options.shards)
        fleet.loop.trace.log = TraceLog() if options.trace else None
        return fleet
    overload = Overload(options.speed, options.on_overload)
    return FreeRunningFleet(scenario, bus, sinks, launcher, startup, overload)


def _lateness(medium_counters: MediumCounters | None) -> str:
    if medium_counters is None or medium_counters.late_s is None:
        return ""
    median_s, worst_s = medium_counters.late_s
    return (
        f"; netem sent batches {median_s * 1e3:.1f} ms (median), {worst_s * 1e3:.1f} ms (worst)"
        " after they were due"
    )


def _finished(
    fleet: FreeRunningFleet | LockstepFleet,
    options: RunOptions,
    cut_off_by: str | None,
    up_s: float | None,
) -> FinishedRun:
    """Return the run for its summary. up_s: when all were present [s; monotonic clock]."""
    resources = fleet.resources.row
    if resources is not None and up_s is not None and options.launched_s is not None:
        resources = {**resources, "start_up_s": up_s - options.launched_s}
    return FinishedRun(
        mode=options.mode,
        loop=fleet.loop,
        medium_counters=fleet.medium_counters,
        late_tick_fraction=fleet.late_fraction,
        late_because=fleet.late_because,
        late_detail=fleet.late_detail,
        unsafe_on_time=fleet.unsafe_on_time,
        late_spell=str(fleet.late_spells or "") or None,
        violated_in_time=fleet.late_spells.violated_in_time if fleet.late_spells else None,
        overload=fleet.overload_row,
        resources=resources,
        real_time_factor=fleet.real_time_factor,
        cut_off_by=cut_off_by,
        failure=fleet.failure,
        rejected_by_world=fleet.rejected,
        commands=fleet.commands.rows(),
        delivery=msgspec.to_builtins(fleet.delivery),
        messages=fleet.messages,
    )
