"""The world as a process: it conducts a fleet of real processes in wall time, and judges it.

Each slot: the truth goes to the medium and observations to the agents that step; what they command
before the next slot is due moves the vehicles. Nothing waits for anybody.
"""

import sys
import time
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
import zenoh

from agent.codec import RejectedError, decode_command, encode
from netem.messages import Truth, Verdicts
from netem.wire.frame import WireError, pack, unpack
from netem.wire.keys import Keys
from netem.wire.post import Post
from netem.wire.session import SessionError, open_client
from netem.wire.stop import Stop
from worldsim.judge.phase import CONVERGED_M
from worldsim.judge.tick import Packets
from worldsim.run.admission import PROCESS_COMMAND_TICKS
from worldsim.run.muster import Muster, MusterError, assemble
from worldsim.run.notebook import notebook
from worldsim.run.outside import Loss, Outside, Progress
from worldsim.run.pace import Pacer, Punctuality
from worldsim.run.rundir import RunDirectory, RunDirectoryError, RunWriteError
from worldsim.run.slots import Opened, Recorder, SlotLoop, world_of
from worldsim.run.summary import EXIT_STATUS, summarise
from worldsim.scenario.tables import Scenario

SENDER_RING = 4
SENDER_QUOTA = 2
LOOK_EVERY_S = 0.25
PROGRESS_EVERY_S = 0.25
FINAL_VERDICTS_WITHIN_S = 1.0
MAX_VERDICTS_B = 64 * 1024
TOO_LATE_FRACTION = 0.01


class Terms(NamedTuple):
    """How a run is flown: its name, how much faster than the wall clock, recorded or not."""

    run: str
    speed: float = 1.0
    recording: bool = True


class Flight:
    """A fleet in the air, slot by slot on the wall clock."""

    def __init__(
        self, scenario: Scenario, post: Post, recorder: Recorder, outside: Outside, speed: float
    ) -> None:
        agents = range(scenario.fleet.agents)
        self.loop = SlotLoop(
            scenario, world_of(scenario, PROCESS_COMMAND_TICKS), recorder, self._packets
        )
        self.verdicts: Verdicts | None = None
        self.punctuality = Punctuality(len(agents))
        self.real_time_factor: float | None = None
        self._scenario = scenario
        self._outside = outside
        self._lost: set[int] = set()
        self.begun = self._landed = False
        self._unreadable = 0
        self._pacer = Pacer(1.0 / (scenario.slot_hz * speed))
        self._progress_at_s = 0.0
        self._truth, self._over = post.putter("truth"), post.putter("over")
        self._observers = [post.putter("observation", agent) for agent in agents]
        self._commands = [post.ring("command", agent, SENDER_RING) for agent in agents]
        self._reports = post.ring("verdicts", size=SENDER_RING)

    @property
    def rejected(self) -> int:
        """Messages refused so far: by the agents, by the medium, and by the world."""
        by_agents = sum(last.telemetry.rejected for last in self.loop.world.latest if last)
        by_medium = sum(self.verdicts.rejected.values()) if self.verdicts is not None else 0
        return by_agents + by_medium + self._unreadable

    def fly(self, unwanted: Callable[[], bool]) -> bool:
        """Fly the scenario's slots until the end, or until unwanted; return whether all of them."""
        self._pacer.start()
        self.begun = True
        slots, world = self._scenario.slots, self.loop.world
        while world.slot < slots and not unwanted():
            self._slot(unwanted)
        self.real_time_factor = world.time_s / max(self._pacer.elapsed_s, 1e-9)
        self.land()
        self.loop.finish()
        return world.slot == slots

    def land(self) -> None:
        """End the run for everybody, once, and take the medium's last counters."""
        if self._landed:
            return
        self._landed = True
        if self.begun:
            self._outside.landing()
        self._over(b"")
        deadline = time.monotonic() + FINAL_VERDICTS_WITHIN_S
        while (left_s := deadline - time.monotonic()) > 0.0:
            report = self._reports.wait(left_s)
            if report is not None:
                self._read_report(report)
            if self.verdicts is not None and self.verdicts.slot >= self.loop.world.slot:
                break

    def _slot(self, unwanted: Callable[[], bool]) -> None:
        slot = self.loop.world.slot
        self._pacer.begin(slot)
        for deed in self.loop.due():
            self.loop.take(deed)  # orders alone are admitted here: they travel in observations
        self._send(self.loop.open())
        self._strike_out()
        while (left_s := self._pacer.left_s(slot + 1)) > 0.0 and not unwanted():
            self._outside.wait(min(left_s, LOOK_EVERY_S))
            self._strike_out()
        for agent, ring in enumerate(self._commands):
            for data in ring.drain(SENDER_QUOTA):
                self._obey(agent, data)
        for report in self._reports.drain(SENDER_RING):
            self._read_report(report)
        self.loop.close(b"")
        self._say_progress()

    def _send(self, opened: Opened) -> None:
        self._truth(pack(Truth(opened.slot, opened.time_s, opened.positions)))
        for agent, observation in opened.observations:
            self._observers[agent](encode(observation))
            self.punctuality.ask(agent, opened.slot, self.loop.world.latest[agent])

    def _obey(self, agent: int, data: bytes) -> None:
        try:
            self.loop.obey(agent, decode_command(data), data)
        except RejectedError:
            self._unreadable += 1

    def _read_report(self, data: bytes) -> None:
        try:
            self.verdicts = unpack(data, Verdicts, MAX_VERDICTS_B)
        except WireError:
            self._unreadable += 1

    def _strike_out(self) -> None:
        for loss in self._outside.losses():
            if loss.agent not in self._lost:
                self._lost.add(loss.agent)
                self.loop.lost(loss.agent, **_known(loss), planned=False)

    def _packets(self) -> Packets:
        return self.verdicts.packets() if self.verdicts is not None else {}

    def _say_progress(self) -> None:
        if self._pacer.elapsed_s >= self._progress_at_s:
            self._progress_at_s = self._pacer.elapsed_s + PROGRESS_EVERY_S
            self._outside.progress(self._progress())

    def _progress(self) -> Progress:
        figures = self.loop.figures
        in_place = int(np.sum(figures.slot_error <= CONVERGED_M)) if figures is not None else 0
        return Progress(
            self.loop.world.time_s,
            self._scenario.duration_s,
            len(self._commands) - len(self._lost),
            in_place,
            self.loop.judge.min_separation_m,
            self.punctuality.late_fraction,
        )


def run(
    connect: str,
    scenario: Scenario,
    directory: Callable[[], RunDirectory],
    terms: Terms,
    outside_of: Callable[[Muster], Outside],
) -> int:
    """Conduct a run at a router, and say in one line what stood in its way; return the status.

    ``directory`` is asked for once the router answers: without one, nothing is made.
    """
    try:
        with open_client(connect) as session:
            return conduct(session, scenario, directory(), terms, outside_of)
    except (SessionError, MusterError, RunDirectoryError) as error:
        print(f"world: {error}", file=sys.stderr)
        return 1 if isinstance(error, RunWriteError) else 2


def conduct(
    session: zenoh.Session,
    scenario: Scenario,
    directory: RunDirectory,
    terms: Terms,
    outside_of: Callable[[Muster], Outside],
) -> int:
    """Assemble a fleet, fly it and judge it; return the exit status of the contract.

    Raises MusterError when not everybody comes. Whatever ends the flight, SIGTERM or an error of
    ours, the recording is finished and a summary written of what there was; a fleet that never
    took off for want of somebody leaves neither.
    """
    stop = Stop()
    post = Post(session, Keys(terms.run))
    post.show_life("world")
    muster = Muster(post, scenario)
    outside = outside_of(muster)
    notes = notebook(directory, scenario, directory.path.name, "processes", terms.recording)
    flight = Flight(scenario, post, notes, outside, terms.speed)
    whole = False

    def unwanted() -> bool:
        return stop.asked or outside.stopped is not None

    try:
        whole = assemble(muster, terms.speed, unwanted, outside) and flight.fly(unwanted)
    finally:
        flight.land()
        notes.close()
        summary = _summary(scenario, flight, interrupted=not whole)
        if flight.begun or stop.asked:
            directory.write_summary(summary)
        else:
            directory.nothing_flew()
    print(f"world: {summary['outcome']}{_lateness(flight.verdicts)}", flush=True)
    return EXIT_STATUS[summary["outcome"]]


def _lateness(verdicts: Verdicts | None) -> str:
    if verdicts is None or verdicts.late_s is None:
        return ""
    typical_s, worst_s = verdicts.late_s
    return f"; netem late by {typical_s * 1e3:.1f} ms (median), {worst_s * 1e3:.1f} ms (worst)"


def _summary(scenario: Scenario, flight: Flight, interrupted: bool) -> dict[str, Any]:
    late = flight.punctuality.late_fraction
    return summarise(
        scenario,
        flight.loop,
        mode="processes",
        verdicts=flight.verdicts,
        rejected=flight.rejected,
        late_tick_fraction=late,
        real_time_factor=flight.real_time_factor,
        duration_s=flight.loop.world.time_s,
        interrupted=interrupted,
        host_too_slow=late is not None and late >= TOO_LATE_FRACTION,
    )


def _known(loss: Loss) -> dict[str, int]:
    return {key: value for key in ("signal", "status") if (value := getattr(loss, key)) is not None}
