"""The world: takes commands, moves vehicles, and gives observations.

A pure state machine over slots. ``slot`` counts them; ``time_s`` is slot / slot_hz, never a sum.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from agent.config import Vehicle
from agent.messages import Command, Observation, Scan, Vector
from worldsim.truth.proximity_sensor import NO_READING, ProximitySensor
from worldsim.truth.scanning_sensors import ScanningSensors
from worldsim.truth.sensor_faults import SensorFaults
from worldsim.truth.vehicle import Poses, Vehicles


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
        self._absent = {*np.flatnonzero(np.isnan(start.position[:, 0])).tolist()}
        """The agents without a vehicle in the world."""
        self.latest: list[Command | None] = [None] * rows
        """The last accepted command of each agent."""
        self.discarded = 0
        """Number of commands that were not accepted."""
        self.sensor_faults = SensorFaults(proximity.seed)
        self._has_proximity = ["proximity" in each.sensors for each in limits]
        self._proximity = proximity
        self._scanning = scanning
        self._max_validity = command_ticks * clock.slots_per_tick
        self._expires = np.zeros(rows, dtype=np.int64)
        # One row for velocity, yaw, pitch and roll, so that a command is one assignment.
        self._commanded = np.zeros((rows, 6))
        self._velocity, self._tilt = self._commanded[:, :3], self._commanded[:, 4:]
        self._yaw = self._commanded[:, 3]
        self._yaw[:] = self.vehicles.yaw

    @property
    def time_s(self) -> float:
        """Simulated time at the start of the present slot [s]."""
        return self.clock.time_s(self.slot)

    def positions(self) -> tuple[Vector | None, ...]:
        """Return true positions, row i = agent i [m; world frame], None where there is none."""
        found: list[Vector | None] = list(map(tuple, self.vehicles.position.tolist()))
        for agent in self._absent:
            found[agent] = None
        return tuple(found)

    def enter(self, agent: int, position: Vector, yaw: float) -> None:
        """Put an agent's vehicle into the world [m; world frame, rad]; it hovers."""
        self.vehicles.place(agent, position, yaw)
        self._absent.discard(agent)
        self._halt(agent)

    def leave(self, agent: int) -> None:
        """Take an agent's vehicle out of the world."""
        self.vehicles.remove(agent)
        self._absent.add(agent)
        self._halt(agent)

    def observe(self, agents: list[int]) -> list[Observation]:
        """Return the present slot's observations of some agents, in their order."""
        read = self._proximity.read(self.vehicles.position, agents, self.slot, self.time_s)
        readings = [
            each if self._has_proximity[agent] else NO_READING
            for agent, each in zip(agents, read, strict=True)
        ]
        scans = self._scans(agents)
        if self.sensor_faults:
            readings = [
                self.sensor_faults.reading(agent, each, self.slot)
                for agent, each in zip(agents, readings, strict=True)
            ]
            scans = {a: self.sensor_faults.scans(a, each, self.slot) for a, each in scans.items()}
        slot, time_s = self.slot, self.time_s
        position = map(tuple, self.vehicles.position.take(agents, axis=0).tolist())
        velocity = map(tuple, self.vehicles.velocity.take(agents, axis=0).tolist())
        yaw = self.vehicles.yaw.take(agents).tolist()
        return [
            Observation(
                slot,
                time_s,
                here,
                motion,
                heading,
                each.vehicles,
                each.obstacles,
                (),
                scans.get(agent, ()),
            )
            for agent, here, motion, heading, each in zip(
                agents, position, velocity, yaw, readings, strict=True
            )
        ]

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
        last = self.latest[agent]
        stale = not self.slot - self.clock.slots_per_tick <= command.slot <= self.slot
        repeated = last is not None and (
            (command.incarnation, command.slot) <= (last.incarnation, last.slot)
        )
        if stale or repeated:
            self.discarded += 1
            return False
        self.latest[agent] = command
        self._expires[agent] = min(command.expires_slot, command.slot + self._max_validity)
        velocity = self.vehicles.within_limits(agent, command.velocity)
        self._commanded[agent] = (*velocity, command.yaw, *command.tilt)
        return True

    def advance(self) -> None:
        """Fly through the present slot; a vehicle whose command has expired stops and hovers."""
        expired = self._expires <= self.slot
        if np.count_nonzero(expired):
            self._hover(expired)
        self.vehicles.integrate(self._velocity, self._yaw, self._tilt, 1.0 / self.clock.slot_hz)
        self.slot += 1

    def _halt(self, agent: int) -> None:
        self._expires[agent] = 0
        self._velocity[agent] = self._tilt[agent] = 0.0
        self._yaw[agent] = self.vehicles.yaw[agent]

    def _hover(self, rows: NDArray[np.bool_]) -> None:
        self._velocity[rows] = 0.0
        self._yaw[rows] = self.vehicles.yaw[rows]
        self._tilt[rows] = self.vehicles.tilt[rows]
