"""The world as a process: it assembles a fleet of real processes, flies it, and judges it."""

import sys
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import zenoh

from netem.messages import MediumCounters
from netem.wire.access import AccessError, login_of
from netem.wire.bus import Bus
from netem.wire.keys import Keys
from netem.wire.session import SessionError, open_client
from netem.wire.shutdown import StopRequest
from worldsim.fleet.free_running import FreeRunningFleet
from worldsim.fleet.launcher_link import LauncherLink
from worldsim.fleet.lockstep import LockstepFleet
from worldsim.fleet.startup import Startup, StartupError, assemble
from worldsim.results.exit_status import EXIT_STATUS
from worldsim.results.run_folder import RunDirectory, RunDirectoryError, RunWriteError
from worldsim.results.sinks import Sinks, open_sinks
from worldsim.results.summary import FinishedRun, Mode, summarise
from worldsim.scenario.tables import Scenario


class Terms(NamedTuple):
    """How a run is flown: its name, how much faster than the wall clock, recorded or not.

    lockstep: in turns, at whatever speed that takes; shards: by how many mediums; users: the file
    of passwords, where the router wants one.
    """

    run: str
    speed: float = 1.0
    recording: bool = True
    lockstep: bool = False
    shards: int = 1
    users: Path | None = None

    @property
    def mode(self) -> Mode:
        """The clock's name in the summary."""
        return "lockstep" if self.lockstep else "processes"


def run(
    connect: str,
    scenario: Scenario,
    directory: Callable[[], RunDirectory],
    terms: Terms,
    launcher_of: Callable[[Startup], LauncherLink],
) -> int:
    """Conduct a run at a router, and say in one line what stood in its way; return the status.

    ``directory`` is asked for once the router answers: without one, nothing is made.
    """
    try:
        login = login_of(terms.users, "world") if terms.users is not None else None
        with open_client(connect, long_lease=terms.lockstep, login=login) as session:
            return conduct(session, scenario, directory(), terms, launcher_of)
    except (AccessError, SessionError, StartupError, RunDirectoryError) as error:
        print(f"world: {error}", file=sys.stderr)
        return 1 if isinstance(error, RunWriteError) else 2


def conduct(
    session: zenoh.Session,
    scenario: Scenario,
    directory: RunDirectory,
    terms: Terms,
    launcher_of: Callable[[Startup], LauncherLink],
) -> int:
    """Assemble a fleet, fly it and judge it; return the exit status of the contract.

    Raises MusterError when not everybody comes. Whatever ends the flight, SIGTERM or an error of
    ours, the recording is finished and a summary written of what there was; a fleet that never
    took off leaves neither.
    """
    stop = StopRequest()
    bus = Bus(session, Keys(terms.run))
    bus.declare_alive("world")
    startup = Startup(bus, scenario, terms.lockstep, terms.shards)
    launcher = launcher_of(startup)
    notes = open_sinks(directory, scenario, directory.path.name, terms.mode, terms.recording)
    flight = _flight(scenario, bus, notes, launcher, startup, terms)
    whole = False

    def unwanted() -> bool:
        return stop.requested or launcher.stopped is not None

    try:
        whole = assemble(startup, terms.speed, unwanted, launcher) and flight.fly(unwanted)
    finally:
        flight.land()
        notes.close()
        ended_by = None if whole else launcher.stopped or "interrupted"
        summary = summarise(scenario, _finished(flight, terms.mode, ended_by))
        if flight.begun:
            directory.write_summary(summary)
        else:
            directory.remove_results()
    told = summary["outcome"] if flight.begun else f"{ended_by} before take-off"
    print(f"world: {told}{_lateness(flight.medium_counters)}", flush=True)
    return EXIT_STATUS[summary["outcome"]]


def _flight(
    scenario: Scenario,
    bus: Bus,
    notes: Sinks,
    launcher: LauncherLink,
    startup: Startup,
    terms: Terms,
) -> FreeRunningFleet | LockstepFleet:
    if terms.lockstep:
        return LockstepFleet(scenario, bus, notes, launcher, startup, terms.shards)
    return FreeRunningFleet(scenario, bus, notes, launcher, startup, terms.speed)


def _lateness(medium_counters: MediumCounters | None) -> str:
    if medium_counters is None or medium_counters.late_s is None:
        return ""
    typical_s, worst_s = medium_counters.late_s
    return f"; netem late by {typical_s * 1e3:.1f} ms (median), {worst_s * 1e3:.1f} ms (worst)"


def _finished(
    flight: FreeRunningFleet | LockstepFleet, mode: Mode, cut_off_by: str | None
) -> FinishedRun:
    return FinishedRun(
        mode=mode,
        loop=flight.loop,
        medium_counters=flight.medium_counters,
        late_tick_fraction=flight.late_fraction,
        real_time_factor=flight.real_time_factor,
        cut_off_by=cut_off_by,
        failure=flight.failure,
        rejected_by_world=flight.refused,
        delivery=flight.delivery,
    )
