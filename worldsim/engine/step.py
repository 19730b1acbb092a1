"""The slot loop, the same under every clock: operations, observations, commands, judging.

Before a slot, a clock carries out each operation that is ``due`` and calls ``apply`` with it. At
the start of the slot it calls ``open``; it takes the observations to the agents and their commands
to ``apply_command``, and then calls ``close``. The clock decides how messages travel.
"""

from collections.abc import Callable, Iterable, Sequence
from math import nan
from typing import Protocol, final

import msgspec
import numpy as np

from agent.messages import ROLES, Believed, Command, Mission, Observation, Report, Vector
from worldsim.engine.controller_counters import ControllerCounters
from worldsim.engine.counters import RadioUse, RejectionCounters
from worldsim.engine.operations import (
    FillDisk,
    Operation,
    StartProcesses,
    StopWorldProcess,
)
from worldsim.engine.queue_neighbours import QueueNeighbours
from worldsim.engine.telemetry import FleetTelemetry
from worldsim.engine.timeline_effects import TimelineEffects
from worldsim.engine.trace import Trace
from worldsim.judge.event import By
from worldsim.judge.run_events import (
    ControllerLogged,
    QueueChanged,
    RoleChanged,
    RunEvent,
    SlotChanged,
)
from worldsim.judge.tick import Packets, Tick
from worldsim.judge.verdict import Figures, Judge
from worldsim.scenario.tables import SLOTS_PER_TICK, Scenario
from worldsim.truth.obstacles import Obstacles
from worldsim.truth.proximity_sensor import ProximitySensor
from worldsim.truth.scanning_sensors import ScanningSensors
from worldsim.truth.start_positions import start_poses_of
from worldsim.truth.vehicle import Poses
from worldsim.truth.world import Clock, World


class Recorder(Protocol):
    """Records a run. It must not raise: it reports its own failures."""

    @property
    def records_ticks(self) -> bool:
        """Whether it records ticks; only then are links and the hierarchy gathered."""

    def tick(self, tick: Tick, figures: Figures) -> None:
        """Record one tick."""

    def observe(self, observations: Sequence[tuple[int, Observation]]) -> None:
        """Record what some agents observe, each given with its agent."""

    def believe(self, agent: int, slot: int, believed: Believed) -> None:
        """Record where an agent takes its neighbours to be at a slot."""

    def report(self, agent: int, slot: int, report: Report) -> None:
        """Record what an agent's controller tells at a slot."""

    def event(self, event: RunEvent) -> None:
        """Record one event."""

    def fill_disk(self, full: bool) -> None:
        """Let every write fail as on a full disk, or no longer."""

    @property
    def failed_writes(self) -> int:
        """Number of writes that failed so far."""


@final
class OpenSlot:
    """The start of a slot: the truth for the medium, an observation for each agent that steps.

    time_s: simulated time [s]. positions: row i = agent i's radio [m; world frame]; None where its
    process is not alive. observations: (agent, observation), agents in ascending order.
    """

    def __init__(
        self,
        slot: int,
        time_s: float,
        positions: tuple[Vector | None, ...],
        observations: list[tuple[int, Observation]],
    ) -> None:
        self.slot = slot
        self.time_s = time_s
        self.positions = positions
        self.observations = observations


def world_of(scenario: Scenario, command_ticks: int) -> World:
    """Return a scenario's world at its start. Raises StartError where there is no room."""
    obstacles = Obstacles(scenario.obstacle)
    start = start_poses_of(scenario, obstacles)
    later = scenario.rows - scenario.fleet.agents
    return World(
        clock=Clock(scenario.fleet.tick_hz, SLOTS_PER_TICK),
        limits=scenario.vehicles,
        start=Poses(
            np.concatenate((start.position, np.full((later, 3), nan))),
            np.concatenate((start.yaw, np.full(later, nan))),
        ),
        proximity=ProximitySensor(scenario.seed, scenario.sensor.proximity.noise_m, obstacles),
        scanning=ScanningSensors(
            scenario.vehicles, scenario.sensor, scenario.seed, scenario.fleet.tick_hz, obstacles
        ),
        command_ticks=command_ticks,
    )


class SlotLoop:
    """Steps a world slot by slot, and passes every tick to the judge and the recorder.

    packets: returns the medium's packet counters; called once a tick. real_outages: whether outages
    and slow controllers strike real processes; otherwise they are modelled here.
    """

    def __init__(
        self,
        scenario: Scenario,
        world: World,
        recorder: Recorder | None = None,
        packets: Callable[[], Packets] = dict,
        real_outages: bool = False,
    ) -> None:
        self._real_outages = real_outages
        self.world = world
        self.judge = Judge(scenario)
        self.trace = Trace()
        self.events: list[RunEvent] = []
        """Every event so far, in order."""
        self.figures: Figures | None = None
        """Of the last tick; None before the first."""
        self.effects = TimelineEffects(scenario, world, self.emit, slow_modelled=not real_outages)
        self.members = self.effects.members
        self.network = self.effects.network
        self._slow = self.effects.slow
        self.radio_use = RadioUse(scenario.rows, scenario.fleet.tick_hz)
        self.controllers = ControllerCounters(scenario.rows)
        self._queue_neighbours = QueueNeighbours(scenario.rows, self.judge.phases)
        self.rejections = RejectionCounters()
        self._recorder = recorder
        self._disk_full: dict[int, int] = {}
        """The faults that let the disk be full: the writes that had failed before each."""
        self._records_ticks = recorder is not None and recorder.records_ticks
        self._packets = packets
        self._headings = list(world.vehicles.yaws)
        """The yaw that each agent last observed [rad; world frame]."""
        self._telemetry = FleetTelemetry(scenario.rows)

    def due(self) -> Iterable[Operation]:
        """Return the operations before this slot; carry out and ``apply`` each before the next."""
        return () if self.effects.nothing_due() else self.effects.due()

    def apply(self, operation: Operation, by: By = None) -> None:
        """Apply an operation that was carried out, and report its events, requested ``by``."""
        stopped = bool(self.network.outages) or _is_pause_of_world(operation)
        if isinstance(operation, FillDisk) and not operation.full:
            self._fill_disk(operation)  # so that its end can be written
        self.effects.apply(operation, by)
        if stopped and not self.network.outages and not self._real_outages:
            self.effects.reconnect()
        if isinstance(operation, FillDisk) and operation.full:
            self._fill_disk(operation)
        if isinstance(operation, StartProcesses):
            for agent in operation.incarnations:
                self._telemetry.forget(agent)

    def open(self) -> OpenSlot:
        """Begin the present slot; at the start of a tick, judge and record the tick first."""
        world = self.world
        self.trace.poses(world.slot, world.vehicles)
        if world.slot % world.clock.slots_per_tick == 0:
            self._judge_tick()
        running, slow = self.members.running.tolist(), self._slow
        if slow:
            self._take_late_answers()
        group = self._observed(running)
        observations = list(zip(group, world.observe(group), strict=True)) if group else []
        for agent, observation in observations:
            self._headings[agent] = observation.yaw
        if self._recorder is not None and self._records_ticks:
            self._recorder.observe(observations)
        if slow:
            observations = [self._with_delay(*each) for each in observations]
        mission = self.effects.missions.unknown(running)
        if mission is not None:
            observations = [self._with_mission(mission, *each) for each in observations]
        return OpenSlot(
            slot=world.slot,
            time_s=world.time_s,
            positions=self._radios(),
            observations=observations,
        )

    def _observed(self, running: list[bool]) -> list[int]:
        """Return the agents that are given an observation of the present slot."""
        slot, slots = self.world.slot, self.world.clock.slots_per_tick
        group = [agent for agent in range(slot % slots, len(running), slots) if running[agent]]
        if self.network.outages:
            self.effects.faults.withhold(self.network.outages.keys(), len(group))
            group = group if self._real_outages else []
        starvation, time_s = self.effects.starvation, self.world.time_s
        if starvation:
            group = [agent for agent in group if not starvation.suppresses(agent, time_s)]
        if self._slow:
            group = [agent for agent in group if self._slow.takes_observation(agent, slot)]
        return group

    def apply_command(self, agent: int, command: Command, encoded: bytes) -> None:
        """Apply an agent's command; in lockstep and virtual time, agents in ascending order."""
        if not self._slow.hold(agent, command, encoded):
            self._take(agent, command, encoded)

    def _take(self, agent: int, command: Command, encoded: bytes) -> None:
        """Apply a command that has come; what a late one tells of its agent counts anyway."""
        accepted = self.world.accept(agent, command)
        if accepted:
            self.trace.command(agent, encoded)
        if accepted or self._slow.is_late(agent, self.world.slot):
            telemetry = command.telemetry
            heading = self._headings[agent]
            self._telemetry.update(agent, telemetry, heading)
            self.controllers.count(agent, telemetry)
            needed = self._queue_neighbours.count(agent, telemetry)
            self.radio_use.count_step(agent, len(telemetry.heard), needed)
            self.effects.missions.report(agent, telemetry.mission, self.world.time_s)
            self._report_place(agent, telemetry.place)
            self._report_role(agent, telemetry.role)
            if telemetry.believed and self._recorder is not None and self._records_ticks:
                self._recorder.believe(agent, command.slot, telemetry.believed)
            if telemetry.report is not None:
                self._tell(agent, command.slot, telemetry.report)
            if telemetry.rejected:
                self.rejections.update(agent, command)

    def close(self, digest: bytes) -> None:
        """End the slot: move the vehicles. digest: the medium's hash over all verdicts."""
        self.trace.verdicts(digest)
        self.world.advance()

    def note_writes(self) -> None:
        """Note the writes that failed during faults that are in force to the end of the run.

        Call it once the recorder has written the rest.
        """
        for number in list(self._disk_full):
            self._note_writes(number)

    def finish(self) -> None:
        """Judge and record the last tick, at the end of the run."""
        if self.world.slot % self.world.clock.slots_per_tick == 0:
            self._judge_tick()

    def emit(self, event: RunEvent) -> None:
        """Append an event, and pass it to the judge and the recorder."""
        self.events.append(event)
        self.judge.handle_event(event)
        if self._recorder is not None:
            self._recorder.event(event)

    def _fill_disk(self, operation: FillDisk) -> None:
        """Let the recorder's disk be full while any fault asks for it."""
        if self._recorder is None:
            return
        number = operation.number
        others = self._disk_full.keys() - {number}
        # At the end of a fault, the recorder first writes what it holds: that fails too.
        self._recorder.fill_disk(operation.full or bool(others))
        if operation.full:
            self._disk_full[number] = self._recorder.failed_writes
        else:
            self._note_writes(number)

    def _note_writes(self, number: int) -> None:
        before = self._disk_full.pop(number, None)
        if before is not None and self._recorder is not None:
            self.effects.faults.note_writes(number, self._recorder.failed_writes - before)

    def _take_late_answers(self) -> None:
        for agent, command, encoded in self._slow.answers(self.world.slot):
            alive = command.incarnation == self.members.incarnations[agent]
            if alive and self.members.running[agent]:
                self._take(agent, command, encoded)

    def _with_delay(self, agent: int, observation: Observation) -> tuple[int, Observation]:
        """Add how long a step takes to the observation of a slow agent."""
        late_slots, takes_s = self._slow.begin_step(agent, observation.slot)
        if late_slots == 0:
            return agent, observation
        late = msgspec.structs.replace(observation, late_slots=late_slots, takes_s=takes_s)
        return agent, late

    def _with_mission(
        self, mission: Mission, agent: int, observation: Observation
    ) -> tuple[int, Observation]:
        """Add a mission to its addressee's observation."""
        if agent != self.effects.addressee:
            return agent, observation
        return agent, msgspec.structs.replace(observation, orders=(mission,))

    def _radios(self) -> tuple[Vector | None, ...]:
        """Return the position of each agent's radio; None where its process is not alive."""
        positions = self.world.positions()
        if self.members.all_alive:
            return positions
        alive = self.members.alive.tolist()
        return tuple(
            position if lives else None for position, lives in zip(positions, alive, strict=True)
        )

    def _tell(self, agent: int, slot: int, report: Report) -> None:
        """Pass on what an agent's controller tells at a slot."""
        t_s = round(self.world.time_s, 6)
        for line in report.log:
            self.emit(ControllerLogged(t_s=t_s, agent=agent, text=line))
        if self._recorder is not None and self._records_ticks:
            self._recorder.report(agent, slot, report)

    def _report_place(self, agent: int, now: tuple[int, int] | None) -> None:
        """Emit events for a change of the place that an agent claims."""
        before = self.effects.places[agent]
        if now == before:
            return
        self.effects.places[agent] = now
        t_s = round(self.world.time_s, 6)
        self.emit(SlotChanged(t_s=t_s, agent=agent, place=now, before=before))
        if before is None or now is None or before[0] != now[0]:
            self.emit(QueueChanged(t_s=t_s, agent=agent, queue=now[0] if now else None))

    def _report_role(self, agent: int, now: int) -> None:
        """Emit an event for a change of an agent's role in the hierarchy of its queue."""
        if now != self.effects.roles[agent]:
            self.effects.roles[agent] = now
            t_s = round(self.world.time_s, 6)
            self.emit(RoleChanged(t_s=t_s, agent=agent, role=ROLES[now]))

    def _judge_tick(self) -> None:
        """Judge and record the present tick."""
        running = self.members.running
        self.radio_use.count_tick(running)
        packets = self._packets()
        tick = self._telemetry.tick(self.world, running, self._records_ticks, packets)
        self.figures = self.judge.see(tick)
        if self._recorder is not None and self._records_ticks:
            self._recorder.tick(tick, self.figures)


def _is_pause_of_world(operation: Operation) -> bool:
    return isinstance(operation, StopWorldProcess) and operation.cause == "pause"
