"""A fleet of real processes in lockstep: simulated time waits for every process.

In each slot the due operations are carried out and confirmed; its input is sent to each medium,
which passes the observations on with the frames; when every agent's command and every medium's
answer have arrived, the vehicles move. Whatever the host's speed and load, the run equals that of
virtual time.
"""

import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import assert_never

from agent.codec import decode_command, encode
from agent.rejection import RejectedError
from netem.delivery_log import Digest, joined_pages
from netem.faults import FaultOrder
from netem.messages import (
    MediumCounters,
    SlotInput,
    SlotResult,
    Truth,
    merged,
    unpack_slot_result,
)
from netem.sender_counts import SenderCounts
from netem.wire.barrier import (
    ANSWER_TIMEOUT_S,
    LOCKSTEP_RING,
    POLL_S,
    LockstepError,
    RunOverError,
    await_message,
    check_slot,
)
from netem.wire.bus import Bus, Subscriber
from netem.wire.frame import WireError, pack
from netem.wire.keys import medium_name
from netem.wire.shutdown import RUN_OVER
from worldsim.engine.operations import (
    AdmitAgents,
    DisturbAgents,
    EndProcesses,
    FillDisk,
    GiveMission,
    Operation,
    PauseProcesses,
    ResumeProcesses,
    SetSensorMode,
    StartProcesses,
    StopWorldProcess,
    ThrottleProcesses,
)
from worldsim.engine.preflight import VIRTUAL_COMMAND_TICKS
from worldsim.engine.step import OpenSlot, Recorder, SlotLoop, world_of
from worldsim.fleet.control import Control, ControlServer
from worldsim.fleet.culprits import Culprits
from worldsim.fleet.ipc import AgentProcess, ProcessAction, names_of
from worldsim.fleet.launcher_link import LauncherLink
from worldsim.fleet.progress import ProgressReporter, StallReporter
from worldsim.fleet.resources import ResourceMeter
from worldsim.fleet.startup import Startup
from worldsim.fleet.world_stop import stop_world
from worldsim.judge.event import By
from worldsim.judge.tick import Packets
from worldsim.scenario.tables import Scenario

DONE_POLL_S = 0.02


class LockstepFleet:
    """A fleet whose processes wait for each other in every slot."""

    late_fraction: float | None = None
    late_because: None = None
    late_detail: None = None
    unsafe_on_time = True
    late_spells: None = None
    overload_row: None = None
    ended_by: None = None
    delivery: None = None
    rejected: Mapping[str, int] = {}
    """Always empty: a message that the world rejects ends the run."""
    commands = SenderCounts()
    """Always empty, like ``rejected``."""
    messages: Mapping[int, int] = {}
    """Always empty: no intruder is started, for a message out of turn would end the run."""

    def __init__(
        self,
        scenario: Scenario,
        bus: Bus,
        recorder: Recorder,
        launcher: LauncherLink,
        startup: Startup,
        shards: int,
    ) -> None:
        rows = range(scenario.rows)
        self.loop = SlotLoop(
            scenario, world_of(scenario, VIRTUAL_COMMAND_TICKS), recorder, self._packets
        )
        self.medium_counters: MediumCounters | None = None
        self.real_time_factor: float | None = None
        self.resources = ResourceMeter(launcher.steps)
        self._agent_steps = 0
        self.failure: str | None = None
        self._culprits = Culprits(launcher.steps, launcher.report_notice, speed=0.0)
        self.begun = self._landed = False
        self._stepping: list[int] = []
        self._stops: list[tuple[StopWorldProcess, By]] = []
        """Stops of the world at the end of the present slot, and who asked for each."""
        self._slots = scenario.slots
        self._launcher = launcher
        self._should_stop: Callable[[], bool] = lambda: False
        self._actions = AwaitedActions(startup, launcher, self._check_exits, self._stopped)
        self._control_server = ControlServer(
            bus, Control(scenario, self.loop, launcher.controls_processes)
        )
        self._progress_reporter = ProgressReporter(scenario.duration_s, self.loop, launcher)
        self._digest = Digest()
        self._truth = bus.publisher("truth", lockstep=True)
        self._over = bus.publisher("over")
        self._commands = [bus.subscriber("command", agent, LOCKSTEP_RING) for agent in rows]
        self._done = [bus.subscriber("done", shard, LOCKSTEP_RING) for shard in range(shards)]

    def fly(self, should_stop: Callable[[], bool]) -> bool:
        """Run the scenario's slots, at most until ``should_stop``; return whether all were run.

        An error in between ends the run, and becomes its ``failure``.
        """
        self._should_stop = should_stop
        self.resources.begin()
        self.begun = True
        begun_s = time.perf_counter()
        try:
            while self.loop.world.slot < self._slots and not should_stop():
                self._slot()
                self._progress_reporter.report(time.perf_counter() - begun_s, None)
        except RunOverError:
            failure = self._launcher_failure()
            self.failure = None if failure is None else f"{failure}{self._blame()}"
            return False
        except LockstepError as error:
            self.failure = f"{error}, {self.loop.world.time_s:.2f} s into the run{self._blame()}"
            return False
        self.failure = self._launcher_failure()
        time_s = self.loop.world.time_s
        self.real_time_factor = time_s / max(time.perf_counter() - begun_s, 1e-9)
        self.resources.end(self._agent_steps)
        self.land()
        self.loop.finish()
        return self.loop.world.slot == self._slots

    def land(self) -> None:
        """End the run for all processes, once."""
        if not self._landed:
            self._landed = True
            if self.begun:
                self._launcher.report_run_over()
            self._over(RUN_OVER)

    def _slot(self) -> None:
        for operation in self.loop.due():
            self._carry_out(operation)
        self._control_server.answer_waiting(self._carry_out)
        self._check_exits()
        opened = self.loop.open()
        self._stepping = [agent for agent, _ in opened.observations]
        self._agent_steps += len(self._stepping)
        self._send(opened)
        for agent, _ in opened.observations:
            self._await_command(agent, opened.slot)
        self.loop.close(self._await_mediums(opened.slot))
        self._stop_world()

    def _carry_out(self, operation: Operation, by: By = None) -> None:
        """Carry out an operation, wait until it is done, and apply it to the world."""
        by = self.loop.effects.asked_by(operation, by)
        self._actions.carry_out(operation, self.loop.members.incarnations, by)
        self.loop.apply(operation, by)
        if isinstance(operation, StopWorldProcess):
            self._stops.append((operation, by))

    def _stop_world(self) -> None:
        """Stop this process where the timeline asks for it; the others wait."""
        for operation, by in self._stops:
            stopped_s = stop_world(operation, self._launcher, 1.0, self._stopped, by)
            self.loop.effects.faults.note_standstill(operation.number, stopped_s)
        self._stops.clear()

    def _send(self, opened: OpenSlot) -> None:
        slot_input = SlotInput(
            truth=Truth(slot=opened.slot, time_s=opened.time_s, positions=opened.positions),
            participants=tuple([agent for agent, _ in opened.observations]),
            observations=tuple([encode(observation) for _, observation in opened.observations]),
            incarnations=tuple(self.loop.members.incarnations),
            orders=self._actions.orders(),
        )
        self._truth(pack(slot_input))

    def _await_command(self, agent: int, slot: int) -> None:
        what = f"agent-{agent}'s command of slot {slot}"
        data = self._answer(self._commands[agent], what)
        try:
            command = decode_command(data)
        except RejectedError as error:
            raise LockstepError(f"{what}: {error}") from error
        check_slot(what, command.slot, slot)
        if command.incarnation != self.loop.members.incarnations[agent]:
            raise LockstepError(f"{what} is of its incarnation {command.incarnation}")
        self.loop.apply_command(agent, command, data)

    def _await_mediums(self, slot: int) -> bytes:
        """Wait until all mediums are done with a slot; return the digest of all fates so far."""
        parts = [self._await_medium(shard, slot) for shard in range(len(self._done))]
        self.medium_counters = merged([part.counters for part in parts])
        self._digest.update(joined_pages(dict(part.pages) for part in parts))
        return self._digest.value

    def _await_medium(self, shard: int, slot: int) -> SlotResult:
        what = f"{medium_name(shard)}'s answer of slot {slot}"
        try:
            done = unpack_slot_result(self._answer(self._done[shard], what))
        except WireError as error:
            raise LockstepError(f"{what}: {error}") from error
        check_slot(what, done.slot, slot)
        return done

    def _answer(self, ring: Subscriber, what: str) -> bytes:
        """Wait for a message; meanwhile check for exits, and whether the run must stop."""
        stall = StallReporter(what, self._launcher)

        def stopped() -> bool:
            stall.add_wait(POLL_S)
            self._culprits.look(self._stepping, self.loop.world.time_s)
            self._check_exits()
            return self._stopped()

        return await_message(ring, what, stopped)

    def _stopped(self) -> bool:
        return self._should_stop()

    def _check_exits(self) -> None:
        """Raise LockstepError when the process of a running or booting agent has ended."""
        for each in self._launcher.agent_exits():
            if self.loop.members.has_process(each.agent, each.incarnation):
                raise LockstepError(str(each))

    def _launcher_failure(self) -> str | None:
        """Return the failure that the launcher has reported, such as netem's exit, or None."""
        self._launcher.agent_exits()
        return self._launcher.failure

    def _blame(self) -> str:
        """Return the process at fault, in brackets; nothing where it is not known."""
        blamed = self._culprits.stop or self._culprits.failure
        return f" ({blamed})" if blamed else ""

    def _packets(self) -> Packets:
        return self.medium_counters.packets() if self.medium_counters is not None else {}


class AwaitedActions:
    """Carries operations out on the other processes, and waits until each has happened."""

    def __init__(
        self,
        startup: Startup,
        launcher: LauncherLink,
        watch: Callable[[], None],
        should_stop: Callable[[], bool],
    ) -> None:
        self._startup = startup
        self._launcher = launcher
        self._watch = watch
        self._should_stop = should_stop
        self._orders: list[FaultOrder] = []

    def carry_out(self, operation: Operation, incarnations: Sequence[int], by: By = None) -> None:
        """Carry out an operation; orders to the medium wait for ``orders``.

        A process starts when its agent has booted: until then there is nothing for it to do.
        incarnations: of all agents, as they were before the operation. by: who asked for it. Raises
        LockstepError when it does not come to pass, RunOverError when the run ends meanwhile.
        """
        match operation:
            case EndProcesses(agents=agents):
                self._act("kill", agents, incarnations, by)
                self._until(lambda: not self._startup.present(agents), f"the end of {agents}")
            case PauseProcesses(agents=agents):
                self._act("pause", agents, incarnations)
            case ResumeProcesses(agents=agents):
                self._act("resume", agents, incarnations)
            case ThrottleProcesses(stops=stops, continues=continues):
                self._act("pause", stops, incarnations)
                self._act("resume", continues, incarnations)
            case AdmitAgents(agents=agents):
                self._begin(agents, incarnations)
            case FaultOrder():
                self._orders.append(operation)
            case StartProcesses() | SetSensorMode() | DisturbAgents() | GiveMission():
                pass  # nothing is to be done in other processes, or before they have booted
            case StopWorldProcess() | FillDisk():
                pass  # a stop waits for the slot's end, and the disk is the world's own
            case _:
                assert_never(operation)

    def orders(self) -> tuple[FaultOrder, ...]:
        """Return, and forget, what the medium is to do before the next slot."""
        orders = tuple(self._orders)
        self._orders.clear()
        return orders

    def _begin(self, agents: tuple[int, ...], incarnations: Sequence[int]) -> None:
        self._startup.expect({agent: incarnations[agent] for agent in agents})
        self._act("start", agents, incarnations)
        self._until(lambda: self._up(agents), f"a sign of life of {agents}")

    def _up(self, agents: tuple[int, ...]) -> bool:
        self._startup.answer_setup_requests()
        self._watch()
        return not self._startup.absent(agents)

    def _act(
        self,
        action: ProcessAction,
        agents: Iterable[int],
        incarnations: Sequence[int],
        by: By = None,
    ) -> None:
        processes = [AgentProcess(agent, incarnations[agent]) for agent in agents]
        if processes:
            self._launcher.request(action, processes, by=by)
            what = f"a {action} of {names_of(processes)}"
            self._until(lambda: self._launcher.has_done(action, processes), what)

    def _until(self, there: Callable[[], bool], what: str) -> None:
        waited_s, stall = 0.0, StallReporter(what, self._launcher)
        while not there():
            if self._should_stop():
                raise RunOverError
            if waited_s > ANSWER_TIMEOUT_S:
                raise LockstepError(f"{what} has not come within {ANSWER_TIMEOUT_S:g} s")
            self._launcher.wait(DONE_POLL_S)
            waited_s += DONE_POLL_S
            stall.add_wait(DONE_POLL_S)
