"""The world: takes commands, moves vehicles, and gives observations.

A pure state machine over slots. ``slot`` counts them; ``time_s`` is slot / slot_hz, never a sum.
"""

from collections.abc import Sequence
from dataclasses import dataclass

from msgspec.structs import replace

from agent.config import Vehicle
from agent.messages import ZERO, Command, Observation, Scan, Vector
from worldsim.truth.agent_clocks import AgentClocks
from worldsim.truth.pose_errors import PoseErrors
from worldsim.truth.proximity_sensor import NO_READING, ProximitySensor
from worldsim.truth.scanning_sensors import ScanningSensors
from worldsim.truth.sensor_faults import SensorFaults
from worldsim.truth.vehicle import LEVEL, Poses, Tilt, Vehicles


@dataclass(frozen=True, slots=True)
class Clock:
    """How simulated time is divided into ticks and slots."""

    tick_hz: float
    """Ticks per second."""
    slots_per_tick: int

    @property
    def slot_hz(self) -> float:
        """Slots per second."""
        return self.tick_hz * self.slots_per_tick

    def time_s(self, slot: int) -> float:
        """Return the simulated time at which a slot starts [s]."""
        return slot / self.slot_hz

    def steps(self, agent: int, slot: int) -> bool:
        """Return whether an agent steps in a slot; agents step in turn and so are asynchronous."""
        return slot % self.slots_per_tick == agent % self.slots_per_tick


class World:
    """Vehicles that fly as they are commanded."""

    def __init__(
        self,
        *,
        clock: Clock,
        limits: Sequence[Vehicle],
        start: Poses,
        proximity: ProximitySensor,
        scanning: ScanningSensors,
        command_ticks: int,
    ) -> None:
        """Start at slot 0.

        limits, start: of each agent's vehicle. command_ticks: longest validity of a command.
        """
        rows = len(start.yaw)
        self.clock = clock
        self.slot = 0
        self.vehicles = Vehicles(start.position, start.yaw, limits)
        self._positions: tuple[Vector | None, ...] | None = None
        """Of the present slot; None until they are needed."""
        self.latest: list[Command | None] = [None] * rows
        """The last accepted command of each agent."""
        self.discarded = 0
        """Number of commands that were not accepted."""
        self.sensor_faults = SensorFaults(proximity.seed)
        self.clocks = AgentClocks()
        self.pose_errors = PoseErrors(proximity.seed)
        self._has_proximity = ["proximity" in each.sensors for each in limits]
        self._proximity = proximity
        self._scanning = scanning
        self._max_validity = command_ticks * clock.slots_per_tick
        self._expires = [0] * rows
        """The slot in which each agent's command expires."""
        self._first_expires = 0
        """No command expires before this slot."""
        self._velocity: list[Vector] = [ZERO] * rows
        self._yaw = list(self.vehicles.yaws)
        self._tilt: list[Tilt] = [LEVEL] * rows

    @property
    def time_s(self) -> float:
        """Simulated time at the start of the present slot [s]."""
        return self.clock.time_s(self.slot)

    @property
    def readings_struck(self) -> dict[int, int]:
        """How many readings each fault of what agents read has changed, by its number."""
        return self.sensor_faults.struck | self.clocks.struck | self.pose_errors.struck

    def redraw(self, seed: int) -> None:
        """Draw the noise of every later reading from another seed."""
        self._proximity.seed = seed
        self._scanning.redraw(seed)
        self.sensor_faults.redraw(seed)
        self.pose_errors.redraw(seed)

    def positions(self) -> tuple[Vector | None, ...]:
        """Return true positions, row i = agent i [m; world frame], None where there is none."""
        found = self._positions
        if found is None:
            found = self.vehicles.present()
            self._positions = found
        return found

    def enter(self, agent: int, position: Vector, yaw: float) -> None:
        """Put an agent's vehicle into the world [m; world frame, rad]; it hovers."""
        self.vehicles.place(agent, position, yaw)
        self._halt(agent)

    def leave(self, agent: int) -> None:
        """Take an agent's vehicle out of the world."""
        self.vehicles.remove(agent)
        self._halt(agent)

    def observe(self, agents: list[int]) -> list[Observation]:
        """Return the present slot's observations of some agents, in their order."""
        slot, time_s, vehicles, clocks = self.slot, self.time_s, self.vehicles, self.clocks
        read = self._proximity.read(self.positions(), agents, slot, time_s)
        readings = [
            read[k] if self._has_proximity[agent] else NO_READING for k, agent in enumerate(agents)
        ]
        scans = self._scans(agents)
        if self.sensor_faults:
            readings = [
                self.sensor_faults.reading(agent, each, self.slot)
                for agent, each in zip(agents, readings, strict=True)
            ]
            scans = {a: self.sensor_faults.scans(a, each, self.slot) for a, each in scans.items()}
        found = [
            Observation(
                slot,
                clocks.shown_s(agent, time_s) if clocks else time_s,
                vehicles.positions[agent],
                vehicles.velocities[agent],
                vehicles.yaws[agent],
                readings[k].vehicles,
                readings[k].obstacles,
                (),
                scans.get(agent, ()) if scans else (),
            )
            for k, agent in enumerate(agents)
        ]
        if not self.pose_errors:
            return found
        return [self._as_measured(agent, each) for agent, each in zip(agents, found, strict=True)]

    def _as_measured(self, agent: int, true: Observation) -> Observation:
        """Return an observation with the pose as the agent measures it."""
        errors = self.pose_errors
        position, yaw = errors.measured(agent, true.position, true.yaw, true.slot)
        if not errors.turns(agent):
            return replace(true, position=position)
        return replace(
            true,
            position=position,
            yaw=yaw,
            velocity=errors.turned(agent, true.velocity),
            vehicles=tuple([errors.turned(agent, each) for each in true.vehicles]),
            obstacles=tuple([errors.turned(agent, each) for each in true.obstacles]),
        )

    def _scans(self, agents: list[int]) -> dict[int, tuple[Scan, ...]]:
        """Return the scans of the present slot, by agent."""
        if not self._scanning.any:
            return {}
        tick = self.slot // self.clock.slots_per_tick
        position, yaw = self.vehicles.position, self.vehicles.yaw
        return self._scanning.read(position, yaw, agents, tick, self.slot, self.time_s)

    def accept(self, agent: int, command: Command) -> bool:
        """Take a command, or discard and count it, and return whether it was taken.

        A command is discarded when it is older than a tick, not newer than the agent's last, or
        ahead of the slot: a process that was paused answers old observations when it goes on.
        """
        slot = command.slot
        stale = not self.slot - self.clock.slots_per_tick <= slot <= self.slot
        if stale or not self._is_newer(agent, command):
            self.discarded += 1
            return False
        self.latest[agent] = command
        expires = min(command.expires_slot, slot + self._max_validity)
        self._expires[agent] = expires
        self._first_expires = min(self._first_expires, expires)
        velocity, self._yaw[agent], self._tilt[agent] = command.velocity, command.yaw, command.tilt
        if self.pose_errors and self.pose_errors.turns(agent):
            velocity = self.pose_errors.turned_back(agent, velocity)
            self._yaw[agent] = self.pose_errors.yaw_back(agent, command.yaw)
        self._velocity[agent] = self.vehicles.within_limits(agent, velocity)
        return True

    def _is_newer(self, agent: int, command: Command) -> bool:
        """Return whether a command is newer than the last accepted one of its agent."""
        last = self.latest[agent]
        if last is None:
            return True
        incarnation, before = command.incarnation, last.incarnation
        return incarnation > before or (incarnation == before and command.slot > last.slot)

    def advance(self) -> None:
        """Fly through the present slot; a vehicle whose command has expired stops and hovers."""
        if self._first_expires <= self.slot:
            self._hover_expired()
        self.vehicles.integrate(self._velocity, self._yaw, self._tilt, 1.0 / self.clock.slot_hz)
        self._positions = None
        self.slot += 1

    def _halt(self, agent: int) -> None:
        self._positions = None
        self._expires[agent] = self._first_expires = 0
        self._velocity[agent], self._tilt[agent] = ZERO, LEVEL
        self._yaw[agent] = self.vehicles.yaws[agent]

    def _hover_expired(self) -> None:
        first = self._expires[0]
        for agent, expires in enumerate(self._expires):
            first = min(first, expires)
            if expires <= self.slot:
                self._velocity[agent] = ZERO
                self._yaw[agent] = self.vehicles.yaws[agent]
                self._tilt[agent] = self.vehicles.tilts[agent]
        self._first_expires = first
