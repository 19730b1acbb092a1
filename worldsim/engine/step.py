"""The slot loop, the same under every clock: what is due, what is observed, what is judged.

Before a slot a clock carries out each operation that is ``due`` and has it ``apply``. It calls
``open`` at the start of a slot, brings the observations to the agents and their commands back to
``obey``, and calls ``close``. How messages travel is the clock's.
"""

from collections.abc import Callable, Iterable
from math import nan
from typing import Protocol

import msgspec
import numpy as np

from agent.messages import Command, Observation, Vector
from worldsim.engine.counters import RadioUse, RejectionCounters
from worldsim.engine.operations import Operation, StartProcesses
from worldsim.engine.telemetry import NO_TELEMETRY, telemetry_row, tick_of
from worldsim.engine.timeline_effects import TimelineEffects
from worldsim.engine.trace import Trace
from worldsim.judge.run_events import By, QueueChanged, RoleChanged, RunEvent, SlotChanged
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
    """Keeps what a run showed. It must never fail the run: it reports its own troubles."""

    @property
    def shows(self) -> bool:
        """Whether it keeps ticks; only then are links and tiers gathered, which are only shown."""

    def tick(self, tick: Tick, figures: Figures) -> None:
        """Keep one tick."""

    def event(self, event: RunEvent) -> None:
        """Keep one event."""


class Opened(msgspec.Struct, frozen=True, gc=False):
    """A slot as it begins: the truth for the medium, an observation for each agent that steps."""

    slot: int
    time_s: float
    positions: tuple[Vector | None, ...]
    """Of the radios [m; world frame]; None for an agent whose process is not alive."""
    observations: list[tuple[int, Observation]]


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
    """Steps a world slot by slot, and shows every tick to the judge and the recorder.

    ``packets`` is asked once a tick for the medium's counters.
    """

    def __init__(
        self,
        scenario: Scenario,
        world: World,
        recorder: Recorder | None = None,
        packets: Callable[[], Packets] = dict,
    ) -> None:
        self.world = world
        self.judge = Judge(scenario)
        self.trace = Trace()
        self.events: list[RunEvent] = []
        self.figures: Figures | None = None
        self.effects = TimelineEffects(scenario, world, self.emit)
        self.members = self.effects.members
        self.network = self.effects.network
        self.radio_use = RadioUse(scenario.rows, scenario.fleet.tick_hz)
        self.rejections = RejectionCounters()
        self._recorder = recorder
        self._shows = recorder is not None and recorder.shows
        self._packets = packets
        self._headings = world.vehicles.yaw.tolist()
        self._telemetry = [NO_TELEMETRY] * scenario.rows

    def due(self) -> Iterable[Operation]:
        """Return what is to happen before this slot; carry out and ``apply`` each in turn."""
        return () if self.effects.nothing_due() else self.effects.due()

    def apply(self, operation: Operation, by: By = None) -> None:
        """Apply an operation that was carried out, and report it as asked for ``by``."""
        self.effects.apply(operation, by)
        if isinstance(operation, StartProcesses):
            for agent in operation.incarnations:
                self._telemetry[agent] = NO_TELEMETRY

    def open(self) -> Opened:
        """Begin the present slot; at a tick, judge and record it first."""
        world = self.world
        self.trace.poses(world.slot, world.vehicles)
        if world.slot % world.clock.slots_per_tick == 0:
            self._see_tick()
        slots, awake = world.clock.slots_per_tick, self.members.awake.tolist()
        group = [agent for agent in range(world.slot % slots, len(awake), slots) if awake[agent]]
        observations = list(zip(group, world.observe(group), strict=True)) if group else []
        for agent, observation in observations:
            self._headings[agent] = observation.yaw
        if self.effects.missions.pending is not None:
            observations = [self._with_mission(*each) for each in observations]
        return Opened(world.slot, world.time_s, self._radios(), observations)

    def obey(self, agent: int, command: Command, encoded: bytes) -> None:
        """Take one agent's command; under a barrier, in order of ids."""
        if self.world.accept(agent, command):
            self.trace.command(agent, encoded)
            telemetry = command.telemetry
            self._telemetry[agent] = telemetry_row(telemetry, self._headings[agent])
            self.radio_use.note(agent, len(telemetry.heard))
            self.effects.missions.report(agent, telemetry.mission)
            self._see_place(agent, telemetry.place)
            if telemetry.rejected:
                self.rejections.note(agent, command)

    def close(self, digest: bytes) -> None:
        """End the slot with the medium's digest: the vehicles fly through it."""
        self.trace.verdicts(digest)
        self.world.advance()

    def finish(self) -> None:
        """Judge and record the last tick, at the end of the run."""
        if self.world.slot % self.world.clock.slots_per_tick == 0:
            self._see_tick()

    def emit(self, event: RunEvent) -> None:
        """Keep an event, and show it to the judge and the recorder."""
        self.events.append(event)
        self.judge.note(event)
        if self._recorder is not None:
            self._recorder.event(event)

    def _with_mission(self, agent: int, observation: Observation) -> tuple[int, Observation]:
        """Add the pending mission to its addressee's observation."""
        mission = self.effects.missions.pending
        if mission is None or agent != self.effects.addressee:
            return agent, observation
        return agent, msgspec.structs.replace(observation, orders=(mission,))

    def _radios(self) -> tuple[Vector | None, ...]:
        positions = self.world.positions()
        if self.members.whole:
            return positions
        alive = self.members.alive.tolist()
        return tuple(where if here else None for where, here in zip(positions, alive, strict=True))

    def _see_place(self, agent: int, now: tuple[int, int] | None) -> None:
        """Report what changes with the place that an agent claims."""
        before = self.effects.places[agent]
        if now == before:
            return
        self.effects.places[agent] = now
        t_s = round(self.world.time_s, 6)
        self.emit(SlotChanged(t_s=t_s, agent=agent, place=now, before=before))
        if before is None or now is None or before[0] != now[0]:
            self.emit(QueueChanged(t_s=t_s, agent=agent, queue=now[0] if now else None))
        if _is_vertex(before) != _is_vertex(now):
            self.emit(
                RoleChanged(t_s=t_s, agent=agent, role="vertex" if _is_vertex(now) else "member")
            )

    def _see_tick(self) -> None:
        awake = self.members.awake
        self.radio_use.tick(awake)
        tick = tick_of(self.world, self._telemetry, awake, self._shows, self._packets())
        self.figures = self.judge.see(tick)
        if self._recorder is not None and self._shows:
            self._recorder.tick(tick, self.figures)


def _is_vertex(place: tuple[int, int] | None) -> bool:
    return place is not None and place[1] == 0
