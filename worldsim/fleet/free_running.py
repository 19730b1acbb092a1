"""A fleet of real processes in the air, slot by slot on the wall clock. Nothing waits for anybody.

Each slot: what the timeline and the operator want is done; the truth goes to the medium and
observations to the agents that step; what they command before the next slot is due moves the
vehicles.
"""

import time
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, assert_never

import msgspec

from agent.codec import RejectedError, decode_command, encode
from netem.faults import FaultOrder
from netem.messages import FaultOrders, MediumCounters, Truth
from netem.wire.bus import Bus
from netem.wire.frame import WireError, pack, unpack
from worldsim.engine.operations import (
    AdmitAgents,
    EndProcesses,
    GiveMission,
    Operation,
    PauseProcesses,
    ResumeProcesses,
    SetSensorMode,
    StartProcesses,
)
from worldsim.engine.preflight import PROCESS_COMMAND_TICKS
from worldsim.engine.step import Opened, Recorder, SlotLoop, world_of
from worldsim.fleet.control import Control, Reception
from worldsim.fleet.delivery_latency import ArrivalBook
from worldsim.fleet.launcher_link import LauncherLink
from worldsim.fleet.pacing import Pacer, Punctuality
from worldsim.fleet.progress import ProgressReporter
from worldsim.fleet.startup import Startup
from worldsim.judge.run_events import By, LateStart
from worldsim.judge.tick import Packets
from worldsim.scenario.tables import Scenario

START_WITHIN_S = 5.0
"""So long before the end of a long boot a process begins, which waits 30 s for word and no more."""
REPORTS_RING = 4
LOOK_EVERY_S = 0.25
FINAL_VERDICTS_WITHIN_S = 1.0
MAX_VERDICTS_B = 64 * 1024


class FreeRunningFleet:
    """A fleet in the air."""

    def __init__(
        self,
        scenario: Scenario,
        bus: Bus,
        recorder: Recorder,
        launcher: LauncherLink,
        startup: Startup,
        speed: float,
    ) -> None:
        rows = range(scenario.rows)
        self.loop = SlotLoop(
            scenario, world_of(scenario, PROCESS_COMMAND_TICKS), recorder, self._packets
        )
        self.medium_counters: MediumCounters | None = None
        self.punctuality = Punctuality(len(rows))
        self.real_time_factor: float | None = None
        self.failure: str | None = None
        self._scenario = scenario
        self._launcher = launcher
        self._startup = startup
        self._actions = ProcessActions(bus, startup, launcher, scenario.fleet.boot_s / speed)
        self._reception = Reception(bus, Control(scenario, self.loop, launcher.launches))
        self.begun = self._landed = False
        self._refused: Counter[str] = Counter()
        self._pacer = Pacer(1.0 / (scenario.slot_hz * speed))
        self._progress_reporter = ProgressReporter(scenario.duration_s, self.loop, launcher)
        self._truth, self._over = bus.publisher("truth"), bus.publisher("over")
        self._observers = [bus.publisher("observation", agent) for agent in rows]
        self._commands = bus.fair_subscriber("command", rows)
        self._reports = bus.subscriber("verdicts", size=REPORTS_RING)
        clock = self.loop.world.clock
        self._book = ArrivalBook(clock.slots_per_tick, 1.0 / clock.slot_hz)
        self._arrivals = [bus.subscriber("arrivals", agent) for agent in rows]
        self._slots_a_report = round(clock.slot_hz)

    @property
    def late_fraction(self) -> float | None:
        """Share of late ticks."""
        return self.punctuality.late_fraction

    @property
    def delivery(self) -> dict[str, Any] | None:
        """How late frames came, as far as the agents told."""
        delivered = (
            self.medium_counters.fates.get("delivered", 0)
            if self.medium_counters is not None
            else 0
        )
        return self._book.summary(delivered)

    @property
    def refused(self) -> Mapping[str, int]:
        """What the world refused so far, by cause; "stale": commands of another time."""
        causes = {**self._refused, "stale": self.loop.world.discarded}
        return {cause: count for cause, count in sorted(causes.items()) if count}

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
            self._launcher.landing()
        self._over(b"")
        deadline = time.monotonic() + FINAL_VERDICTS_WITHIN_S
        while (left_s := deadline - time.monotonic()) > 0.0:
            report = self._reports.wait(left_s)
            if report is not None:
                self._read_report(report)
            if (
                self.medium_counters is not None
                and self.medium_counters.slot >= self.loop.world.slot
            ):
                break
        for agent in range(len(self._arrivals)):
            self._read_arrivals(agent)

    def _slot(self, unwanted: Callable[[], bool]) -> None:
        slot = self.loop.world.slot
        self._pacer.begin(slot)
        self._startup.instruct_agents()
        for operation in self.loop.due():
            self._carry_out(operation)
        self._reception.attend(self._carry_out)
        self._send(self.loop.open())
        self._strike_out()
        while (left_s := self._pacer.left_s(slot + 1)) > 0.0 and not unwanted():
            self._launcher.wait(min(left_s, LOOK_EVERY_S))
            self._strike_out()
        for agent, said in self._commands.drain():
            for data in said:
                self._obey(agent, data)
        for report in self._reports.drain(REPORTS_RING):
            self._read_report(report)
        # Each agent tells once a second, and so often it is asked, each in a slot of its own.
        for agent in range(slot % self._slots_a_report, len(self._arrivals), self._slots_a_report):
            self._read_arrivals(agent)
        self.loop.close(b"")
        self._progress_reporter.tell(self._pacer.elapsed_s, self.late_fraction)

    def _carry_out(self, operation: Operation, by: By = None) -> None:
        """Carry out what happens between slots, and apply it at once."""
        members = self.loop.members
        late = self._actions.carry_out(operation, self.loop.world.slot, members.incarnations)
        self.loop.apply(operation, by)
        if isinstance(operation, EndProcesses | PauseProcesses | ResumeProcesses | AdmitAgents):
            self.punctuality.forget(operation.agents)
        for agent in late:
            t_s = round(self.loop.world.time_s, 6)
            detail = "its process is not up by the end of boot_s"
            self.loop.emit(LateStart(t_s=t_s, agent=agent, detail=detail))

    def _send(self, opened: Opened) -> None:
        incarnations = tuple(self.loop.members.incarnations)
        self._truth(pack(Truth(opened.slot, opened.time_s, opened.positions, incarnations)))
        for agent, observation in opened.observations:
            self._observers[agent](encode(observation))
            self.punctuality.ask(agent, opened.slot, self.loop.world.latest[agent])

    def _obey(self, agent: int, data: bytes) -> None:
        """Take a command; what one who takes no part, or no more, had under way moves nothing."""
        if not self.loop.members.awake[agent]:
            return
        try:
            command = decode_command(data)
        except RejectedError as error:
            self._refused[error.cause] += 1
            return
        if command.incarnation == self.loop.members.incarnations[agent]:
            self.loop.obey(agent, command, data)
        else:
            self._refused["incarnation"] += 1

    def _read_report(self, data: bytes) -> None:
        try:
            self.medium_counters = unpack(data, MediumCounters, MAX_VERDICTS_B)
        except WireError:
            self._refused["verdicts"] += 1

    def _read_arrivals(self, agent: int) -> None:
        incarnation, now_s = self.loop.members.incarnations[agent], self.loop.world.time_s
        for data in self._arrivals[agent].drain(1):
            try:
                self._book.take(agent, incarnation, data, now_s)
            except WireError:
                self._refused["arrivals"] += 1

    def _strike_out(self) -> None:
        for loss in self._launcher.losses():
            if self.loop.members.has(loss.agent, loss.incarnation):
                self.loop.effects.exited(loss.agent, loss.signal, loss.status)

    def _packets(self) -> Packets:
        return self.medium_counters.packets() if self.medium_counters is not None else {}


class ProcessActions:
    """Carries operations out on the other processes: signals and starts, and orders to the medium.

    It waits for nothing: an operation is done within milliseconds, or reported as late.
    """

    def __init__(
        self, bus: Bus, startup: Startup, launcher: LauncherLink, boot_wall_s: float
    ) -> None:
        self._orders = bus.publisher("orders")
        self._startup = startup
        self._launcher = launcher
        self._after_s = max(0.0, boot_wall_s - START_WITHIN_S)

    def carry_out(self, operation: Operation, slot: int, incarnations: Sequence[int]) -> list[int]:
        """Carry out an operation before a slot; return admitted agents that are not up.

        incarnations: of all agents, as they were before the operation.
        """
        match operation:
            case EndProcesses(agents=agents):
                self._launcher.act("kill", _with_incarnation(agents, incarnations))
            case PauseProcesses(agents=agents):
                self._launcher.act("pause", _with_incarnation(agents, incarnations))
            case ResumeProcesses(agents=agents):
                self._launcher.act("resume", _with_incarnation(agents, incarnations))
            case StartProcesses(incarnations=started):
                self._startup.expect(started)
                self._launcher.act("start", list(started.items()), self._after_s)
            case AdmitAgents(agents=agents):
                return self._startup.absent(agents)
            case FaultOrder():
                self._orders(msgspec.json.encode(FaultOrders(slot, (operation,))))
            case SetSensorMode() | GiveMission():
                pass  # sensors and missions are the world's own
            case _:
                assert_never(operation)
        return []


def _with_incarnation(agents: Iterable[int], incarnations: Sequence[int]) -> list[tuple[int, int]]:
    return [(agent, incarnations[agent]) for agent in agents]
