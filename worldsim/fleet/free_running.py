"""A fleet of real processes, slot by slot on the wall clock; no process waits for another.

In each slot the operations of the timeline and the operator are carried out, the truth is sent to
the medium and observations to the agents that step; the commands that arrive before the next slot
is due move the vehicles.
"""

import time
from collections import Counter
from collections.abc import Callable, Iterable, Mapping

import msgspec
import numpy as np

from agent.codec import decode_command, encode
from agent.messages import Observation
from agent.rejection import RejectedError
from netem.messages import MediumCounters, Truth
from netem.sender_counts import SenderCounts
from netem.wire.bus import Bus
from netem.wire.frame import WireError, pack, unpack
from netem.wire.keys import agent_name
from netem.wire.shutdown import RUN_OVER
from worldsim.engine.operations import (
    AdmitAgents,
    EndProcesses,
    Operation,
    PauseProcesses,
    ResumeProcesses,
    StopWorldProcess,
    ThrottleProcesses,
)
from worldsim.engine.preflight import PROCESS_COMMAND_TICKS
from worldsim.engine.step import OpenSlot, Recorder, SlotLoop, world_of
from worldsim.fleet.control import Control, ControlServer
from worldsim.fleet.culprits import Culprits, ForeignSteps
from worldsim.fleet.delivery_latency import DeliveryLatency, LatencyCollector
from worldsim.fleet.late_under_attack import LateUnderAttack, attackers
from worldsim.fleet.launcher_link import LauncherLink
from worldsim.fleet.netem_process import NetemProcess
from worldsim.fleet.overload import REMEDIES, LateSpells, Overload, percent
from worldsim.fleet.pacing import LatenessCounter, Pacer
from worldsim.fleet.process_actions import ProcessActions
from worldsim.fleet.progress import ProgressReporter
from worldsim.fleet.reconnection import Reconnection
from worldsim.fleet.resources import ResourceMeter
from worldsim.fleet.startup import Startup
from worldsim.fleet.unsafe_agents import ON_TIME_FOR_S, UnsafeAgents
from worldsim.fleet.world_stop import stop_world
from worldsim.judge.event import By
from worldsim.judge.run_events import LateStart
from worldsim.judge.tick import Packets
from worldsim.results.finished_run import OverloadRow
from worldsim.scenario.tables import Scenario

REPORTS_RING = 4
POLL_S = 0.25
BEHIND_S = 0.1
"""The world is said to have fallen behind where it did so by more [s; wall time]."""
FINAL_VERDICTS_WITHIN_S = 1.0
MAX_VERDICTS_B = 64 * 1024


class FreeRunningFleet:
    """A fleet that runs on the wall clock."""

    def __init__(
        self,
        scenario: Scenario,
        bus: Bus,
        recorder: Recorder,
        launcher: LauncherLink,
        startup: Startup,
        overload: Overload,
    ) -> None:
        speed = overload.requested
        rows = range(scenario.rows)
        self.loop = SlotLoop(
            scenario,
            world_of(scenario, PROCESS_COMMAND_TICKS),
            recorder,
            self._packets,
            real_outages=True,
        )
        self.medium_counters: MediumCounters | None = None
        self.lateness = LatenessCounter(len(rows))
        self._unsafe = UnsafeAgents(scenario.control.separation_m, scenario.obstacle_bound_m)
        self.overload = overload
        self.late_spells, self._under_attack = LateSpells(), LateUnderAttack()
        self.real_time_factor: float | None = None
        self.resources = ResourceMeter(launcher.steps)
        self._agent_steps = self._ticks_seen = 0
        self._culprits = Culprits(launcher.steps, launcher.report_notice, speed)
        self._foreign_steps = ForeignSteps(launcher.steps, scenario.commands)
        self._late_agents: list[int] = []
        self._scenario = scenario
        self._launcher, self._startup = launcher, startup
        self._netem = NetemProcess(bus, startup, launcher, self.loop.network, speed)
        self._reconnection = Reconnection(speed)
        self._stops: list[tuple[StopWorldProcess, By]] = []
        """Stops of the world at the end of the present slot."""
        boot_wall_s = scenario.fleet.boot_s / speed
        self._actions = ProcessActions(self._netem, startup, launcher, boot_wall_s)
        self._control_server = ControlServer(
            bus, Control(scenario, self.loop, launcher.controls_processes)
        )
        self.begun = self._landed = False
        self._rejected, self.commands = Counter[str](), SenderCounts()
        self._pacer = Pacer(1.0 / (scenario.slot_hz * speed))
        self._progress_reporter = ProgressReporter(scenario.duration_s, self.loop, launcher)
        self._truth, self._over = bus.publisher("truth"), bus.publisher("over")
        self._observers = [bus.publisher("observation", agent) for agent in rows]
        self._commands = bus.fair_subscriber("command", rows)
        self._reports = bus.subscriber("verdicts", size=REPORTS_RING)
        clock = self.loop.world.clock
        self._latency = LatencyCollector(clock.slots_per_tick, 1.0 / clock.slot_hz)
        self._arrivals = [bus.subscriber("arrivals", agent) for agent in rows]
        self._slots_per_report = round(clock.slot_hz)

    @property
    def late_fraction(self) -> float | None:
        """Share of late ticks."""
        return self.lateness.late_fraction

    @property
    def failure(self) -> str | None:
        """Why the run has failed whatever it showed: an agent ended or hangs. None: it has not."""
        return self._culprits.failure

    @property
    def late_because(self) -> str | None:
        """Who but the host makes ticks late; None: nobody else is known."""
        ticks = self.loop.world.time_s * self._scenario.fleet.tick_hz
        return self._culprits.stop or self._culprits.slow(ticks)

    @property
    def late_detail(self) -> str | None:
        """Who was late on a host that was too slow, and what to do; None: nobody was."""
        latest, behind_s = self.lateness.latest, self._pacer.behind_s
        if latest is None:
            return None
        agent, share = latest
        world = f"; the world fell behind by {behind_s:.1f} s" if behind_s >= BEHIND_S else ""
        attack = f", {self._under_attack}" if str(self._under_attack) else ""
        whose = f"most often those of {agent_name(agent)} ({percent(share)}){attack}"
        return f"{whose}{world}; {REMEDIES}"

    @property
    def unsafe_on_time(self) -> bool:
        """Whether agents that were on time have broken safety."""
        return self._unsafe.on_time

    @property
    def ended_by(self) -> str | None:
        """Why the fleet itself ended the run before its time: an overload. None: it did not."""
        reason = self.overload.abort_reason
        if reason is None or self.late_because is None:
            return reason
        return f"{self.late_because}: {reason}"

    @property
    def overload_row(self) -> OverloadRow:
        """What the summary says of overload."""
        return {"policy": self.overload.policy, "least_speed": self.overload.least_speed}

    @property
    def delivery(self) -> DeliveryLatency | None:
        """How late frames arrived, from the agents' counts; None without a frame."""
        delivered = (
            self.medium_counters.fates.get("delivered", 0)
            if self.medium_counters is not None
            else 0
        )
        return self._latency.summary(delivered)

    @property
    def messages(self) -> Mapping[int, int]:
        """How many messages each intruder has put, by its fault's number."""
        intruders = self.loop.effects.faults.of_kind("intruder")
        put = {each.number: self._launcher.messages_put(each.number) for each in intruders}
        return {number: count for number, count in put.items() if count is not None}

    @property
    def rejected(self) -> Mapping[str, int]:
        """Number of messages that the world rejected, by cause; "stale": outdated commands."""
        causes = {**self._rejected, "stale": self.loop.world.discarded}
        return {cause: count for cause, count in sorted(causes.items()) if count}

    def fly(self, should_stop: Callable[[], bool]) -> bool:
        """Run the scenario's slots, at most until ``should_stop``; return whether all were run."""
        self.resources.begin()
        self._pacer.start()
        self.begun = True
        slots, world = self._scenario.slots, self.loop.world
        while world.slot < slots and not should_stop() and self.overload.abort_reason is None:
            self._slot(should_stop)
        self.real_time_factor = world.time_s / max(self._pacer.elapsed_s, 1e-9)
        self.resources.end(self._agent_steps)
        self.land()
        self.loop.finish()
        return world.slot == slots

    def land(self) -> None:
        """End the run for all processes, once, and read the last counters."""
        if self._landed:
            return
        self._landed = True
        self._netem.wake()
        if self.begun:
            self._launcher.report_run_over()
        self._over(RUN_OVER)
        deadline = time.monotonic() + FINAL_VERDICTS_WITHIN_S
        while self._netem.state == "up" and (left_s := deadline - time.monotonic()) > 0.0:
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

    def _slot(self, should_stop: Callable[[], bool]) -> None:
        slot = self.loop.world.slot
        self._pacer.begin(slot)
        self._startup.answer_setup_requests()
        for operation in self.loop.due():
            self._carry_out(operation)
        self._control_server.answer_waiting(self._carry_out)
        self._report_reconnection()
        self._send(self.loop.open())
        self._handle_exits()
        self._culprits.look(self._late_agents, self.loop.world.time_s)
        self._note_late_ticks(slot)
        self._unsafe.see(self.loop.figures, self._was_on_time)
        while (left_s := self._pacer.left_s(slot + 1)) > 0.0 and not should_stop():
            self._launcher.wait(min(left_s, POLL_S))
            self._handle_exits()
        self._netem.follow(slot, self.medium_counters)
        self._count_lost()
        for agent, commands in self._commands.drain():
            for data in commands:
                self._accept_command(agent, data)
        for report in self._reports.drain(REPORTS_RING):
            self._read_report(report)
        # Each agent reports once a second; the reads are spread over the slots of a second.
        for agent in range(
            slot % self._slots_per_report, len(self._arrivals), self._slots_per_report
        ):
            self._read_arrivals(agent)
        self.loop.close(b"")
        self._stop_world(should_stop)
        slowed_to = self.overload.speed if self.overload.slowed else None
        self._progress_reporter.report(self._pacer.elapsed_s, self.late_fraction, slowed_to)

    def _was_on_time(self, agent: int) -> bool:
        """Return whether an agent has been on time lately; one that does not step is never late."""
        on_time_slots = round(ON_TIME_FOR_S * self._scenario.slot_hz)
        return self.lateness.on_time_since(agent, self.loop.world.slot - on_time_slots)

    def _note_late_ticks(self, slot: int) -> None:
        """Follow the overload; an agent that hangs or was stopped tells nothing of the host."""
        late = sum(not self._culprits.named(agent) for agent in self._late_agents)
        self._late_agents.clear()
        ticks, self._ticks_seen = self.lateness.ticks - self._ticks_seen, self.lateness.ticks
        before = self.overload.speed
        faults = self.loop.effects.faults
        intruders = [each.number for each in faults.of_kind("intruder") if each.to_s is None]
        self._under_attack.note(late, intruders)
        attack = attackers(intruders)
        self._note_spell(ticks, late, attack)
        report = self.overload.note(self._pacer.elapsed_s, ticks, late)
        if report is not None:
            self._launcher.report_notice(f"{report} ({attack})" if attack else report)
        if self.overload.speed != before:
            self._pacer.change(slot, 1.0 / (self._scenario.slot_hz * self.overload.speed))

    def _note_spell(self, ticks: int, late: int, attack: str) -> None:
        """Note how late ticks are, and which invariants are violated meanwhile."""
        self.late_spells.add(self._pacer.elapsed_s, ticks, late, self.loop.world.time_s, attack)
        tallies = self.loop.judge.invariants()
        self.late_spells.note({name: tally.violations for name, tally in tallies.items()})

    def _carry_out(self, operation: Operation, by: By = None) -> None:
        """Carry out an operation between slots, and apply it to the world at once."""
        members = self.loop.members
        by = self.loop.effects.asked_by(operation, by)
        late = self._actions.carry_out(operation, self.loop.world.slot, members.incarnations, by)
        was_down = bool(self.loop.network.outages)
        self.loop.apply(operation, by)
        self._follow_outage(was_down=was_down)
        if isinstance(operation, StopWorldProcess):
            self._stops.append((operation, by))
        if isinstance(operation, EndProcesses | PauseProcesses | ResumeProcesses | AdmitAgents):
            self._expect_nothing(operation.agents)
        if isinstance(operation, ThrottleProcesses):
            self._expect_nothing(operation.stops)
        for agent in late:
            t_s = round(self.loop.world.time_s, 6)
            detail = "its process is not up by the end of boot_s"
            self.loop.emit(LateStart(t_s=t_s, agent=agent, detail=detail))

    def _expect_nothing(self, agents: Iterable[int]) -> None:
        """Await no command of agents for the observations that they were sent so far."""
        self.lateness.drop_pending(agents)
        self._foreign_steps.end(agents)

    def _follow_outage(self, *, was_down: bool) -> None:
        """Await the agents' observation after the end of an outage, and not in one."""
        if self.loop.network.outages:
            self._reconnection.cancel()
        elif was_down:
            self._await_reconnection(self._netem.paused_s)

    def _await_reconnection(self, paused_s: float) -> None:
        running = np.flatnonzero(self.loop.members.running).tolist()
        self._reconnection.begin(running, self.loop.world.time_s, paused_s)

    def _report_reconnection(self) -> None:
        """Report it once every running agent is observed again, or should be."""
        awaited, time_s = self._reconnection, self.loop.world.time_s
        if awaited.since_s is None or self._netem.state != "up":
            return
        missing = awaited.missing(np.flatnonzero(self.loop.members.running).tolist())
        if not missing or awaited.is_late(time_s):
            self.loop.effects.reconnect(time_s - awaited.since_s, missing)
            awaited.cancel()

    def _stop_world(self, should_stop: Callable[[], bool]) -> None:
        """Stop this process where the timeline asks for it, after what it did is written."""
        for operation, by in self._stops:
            speed = self.overload.speed
            stopped_s = stop_world(operation, self._launcher, speed, should_stop, by)
            self.loop.effects.faults.note_standstill(operation.number, stopped_s)
            self._pacer.stand_still(stopped_s)
            if not self.loop.network.outages:
                self._await_reconnection(stopped_s)
        self._stops.clear()

    def _is_cut_off(self, agent: int) -> bool:
        """Return whether a planned stop keeps observations from an agent: no tick of it counts."""
        return (
            bool(self.loop.network.outages)
            or self._netem.state != "up"
            or self._reconnection.awaits(agent)
        )

    def _send(self, opened: OpenSlot) -> None:
        incarnations = tuple(self.loop.members.incarnations)
        truth = Truth(
            slot=opened.slot,
            time_s=opened.time_s,
            positions=opened.positions,
            incarnations=incarnations,
        )
        takes_messages = self._netem.takes_messages
        if takes_messages:
            self._truth(pack(truth))
        self._agent_steps += len(opened.observations)
        for agent, observation in opened.observations:
            if takes_messages:
                self._observers[agent](encode(self._in_wall_time(observation)))
            if self._is_cut_off(agent) or self.loop.effects.slow.is_late(agent, opened.slot):
                self._expect_nothing([agent])
                continue
            self._foreign_steps.begin(agent)
            if self.lateness.observe(agent, opened.slot, self.loop.world.latest[agent]):
                self._late_agents.append(agent)

    def _in_wall_time(self, observation: Observation) -> Observation:
        """Return an observation that tells how long its step takes in wall time."""
        if observation.takes_s == 0.0:
            return observation
        return msgspec.structs.replace(
            observation, takes_s=observation.takes_s / self.overload.speed
        )

    def _accept_command(self, agent: int, data: bytes) -> None:
        """Take a command; one of an agent that is not running any more has no effect."""
        if not self.loop.members.running[agent]:
            return
        self._foreign_steps.end([agent])
        try:
            command = decode_command(data)
        except RejectedError as error:
            self._refuse_command(agent, error.cause)
            return
        if command.incarnation != self.loop.members.incarnations[agent]:
            self._refuse_command(agent, "incarnation")
            return
        self._reconnection.hear(agent, self.loop.world.clock.time_s(command.slot))
        discarded = self.loop.world.discarded
        self.loop.apply_command(agent, command, data)
        self.commands.count(agent, "stale" if self.loop.world.discarded > discarded else None)

    def _refuse_command(self, agent: int, cause: str) -> None:
        self._rejected[cause] += 1
        self.commands.count(agent, cause)

    def _read_report(self, data: bytes) -> None:
        try:
            self.medium_counters = unpack(data, MediumCounters, MAX_VERDICTS_B)
        except WireError:
            self._rejected["verdicts"] += 1
        self._count_lost()

    def _count_lost(self) -> None:
        """Count frames in flight as lost where netem's process was killed."""
        if self.medium_counters is not None and self._netem.state in ("dead", "starting"):
            self.medium_counters = self.medium_counters.after_kill()

    def _read_arrivals(self, agent: int) -> None:
        incarnation, now_s = self.loop.members.incarnations[agent], self.loop.world.time_s
        for data in self._arrivals[agent].drain(1):
            try:
                self._latency.add(agent, incarnation, data, now_s)
            except WireError:
                self._rejected["arrivals"] += 1

    def _handle_exits(self) -> None:
        for ended in self._launcher.agent_exits():
            if self.loop.members.has_process(ended.agent, ended.incarnation):
                self.loop.effects.record_exit(ended.agent, *ended.exit)
                time_s = self.loop.world.time_s
                self._culprits.note_exit(ended.agent, ended.exit, time_s, ended.log_end)

    def _packets(self) -> Packets:
        return self.medium_counters.packets() if self.medium_counters is not None else {}
