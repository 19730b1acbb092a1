"""The world: commands in, vehicles fly, observations out.

A pure state machine over slots; ``slot`` counts them, ``time_s`` is slot / slot_hz, never a sum.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import isnan

import numpy as np
from numpy.typing import NDArray

from agent.config import Vehicle
from agent.messages import Command, Observation, Scan, Vector
from worldsim.truth.proximity_sensor import ProximitySensor, Sensed
from worldsim.truth.scanning_sensors import Scans
from worldsim.truth.sensor_faults import SensorFaults
from worldsim.truth.vehicle import Fleet, Floats

NOTHING = Sensed(())


@dataclass(frozen=True, slots=True)
class Clock:
    """How simulated time is cut: ``slots_per_tick`` slots to a tick, ``tick_hz`` ticks a second."""

    tick_hz: float
    slots_per_tick: int

    @property
    def slot_hz(self) -> float:
        """Slots per second."""
        return self.tick_hz * self.slots_per_tick

    def time_s(self, slot: int) -> float:
        """Return the simulated time at which a slot starts [s]."""
        return slot / self.slot_hz

    def steps(self, agent: int, slot: int) -> bool:
        """Whether an agent steps in a slot: agents take turns, so they are asynchronous."""
        return slot % self.slots_per_tick == agent % self.slots_per_tick


class World:
    """Vehicles under commands.

    limits: each agent's vehicle. command_ticks: for how many ticks a command may be valid at most.
    """

    def __init__(
        self,
        *,
        clock: Clock,
        limits: Sequence[Vehicle],
        position: Floats,
        yaw: Floats,
        sensor: ProximitySensor,
        scans: Scans,
        command_ticks: int,
    ) -> None:
        self.clock = clock
        self.slot = 0
        self.fleet = Fleet(position, yaw, limits)
        self.latest: list[Command | None] = [None] * len(yaw)
        self.discarded = 0
        self._senses = ["proximity" in each.sensors for each in limits]
        self._sensor = sensor
        self._scanning = scans
        self.failures = SensorFaults(sensor.seed)
        self._longest = command_ticks * clock.slots_per_tick
        self._expires = np.zeros(len(yaw), dtype=np.int64)
        # A row each: velocity, yaw, pitch and roll, so that a command is one assignment.
        self._commanded = np.zeros((len(yaw), 6))
        self._velocity, self._tilt = self._commanded[:, :3], self._commanded[:, 4:]
        self._yaw = self._commanded[:, 3]
        self._yaw[:] = self.fleet.yaw

    @property
    def time_s(self) -> float:
        """Simulated time at the start of the present slot [s]."""
        return self.clock.time_s(self.slot)

    def positions(self) -> tuple[Vector | None, ...]:
        """Return true positions, row i = agent i [m; world frame], None where there is none."""
        return tuple([None if isnan(x) else (x, y, z) for x, y, z in self.fleet.position.tolist()])

    def enter(self, agent: int, position: Vector, yaw: float) -> None:
        """Put an agent's vehicle into the world [m; world frame, rad]; it hovers."""
        self.fleet.place(agent, position, yaw)
        self._halt(agent)

    def leave(self, agent: int) -> None:
        """Take an agent's vehicle out of the world."""
        self.fleet.remove(agent)
        self._halt(agent)

    def observe(self, looking: list[int]) -> list[Observation]:
        """Return the present slot's observations of these agents, in their order."""
        read = self._sensor.read(self.fleet.position, looking, self.slot, self.time_s)
        sensed = [
            each if self._senses[agent] else NOTHING
            for agent, each in zip(looking, read, strict=True)
        ]
        scans = self._scans(looking)
        if self.failures:
            sensed = [
                self.failures.sensed(agent, each, self.slot)
                for agent, each in zip(looking, sensed, strict=True)
            ]
            scans = {a: self.failures.scans(a, each, self.slot) for a, each in scans.items()}
        slot, time_s = self.slot, self.time_s
        position = self.fleet.position.take(looking, axis=0).tolist()
        velocity = self.fleet.velocity.take(looking, axis=0).tolist()
        yaw = self.fleet.yaw.take(looking).tolist()
        return [
            Observation(
                slot,
                time_s,
                (x, y, z),
                (u, v, w),
                heading,
                each.vehicles,
                each.obstacles,
                (),
                scans.get(agent, ()),
            )
            for agent, (x, y, z), (u, v, w), heading, each in zip(
                looking, position, velocity, yaw, sensed, strict=True
            )
        ]

    def _scans(self, looking: list[int]) -> dict[int, tuple[Scan, ...]]:
        """Return what was scanned in the present slot, by agent."""
        if not self._scanning.any:
            return {}
        tick = self.slot // self.clock.slots_per_tick
        fleet = self.fleet
        return self._scanning.read(fleet.position, fleet.yaw, looking, tick, self.slot, self.time_s)

    def obey(self, agent: int, command: Command) -> bool:
        """Take a command, or discard and count it: too old, not newer than the last, or ahead.

        A process that was stopped for a while answers old observations when it goes on; what it
        says then must move nothing.
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
        self._expires[agent] = min(command.expires_slot, command.slot + self._longest)
        velocity = self.fleet.within_limits(agent, command.velocity)
        self._commanded[agent] = (*velocity, command.yaw, *command.tilt)
        return True

    def advance(self) -> None:
        """Fly through the present slot; a vehicle whose command has expired stops and hovers."""
        expired = self._expires <= self.slot
        if np.count_nonzero(expired):
            self._hover(expired)
        self.fleet.integrate(self._velocity, self._yaw, self._tilt, 1.0 / self.clock.slot_hz)
        self.slot += 1

    def _halt(self, agent: int) -> None:
        self._expires[agent] = 0
        self._velocity[agent] = self._tilt[agent] = 0.0
        self._yaw[agent] = self.fleet.yaw[agent]

    def _hover(self, rows: NDArray[np.bool_]) -> None:
        self._velocity[rows] = 0.0
        self._yaw[rows] = self.fleet.yaw[rows]
        self._tilt[rows] = self.fleet.tilt[rows]
