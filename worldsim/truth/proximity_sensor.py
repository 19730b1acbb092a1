"""The proximity sensor: relative positions of near vehicles and of near obstacles' surfaces."""

from typing import Final, final

import numpy as np

from agent.messages import MAX_OBSTACLE_POINTS, PROXIMITY_RANGE_M, Vector
from netem.range_index import RangeIndex
from worldsim.truth.obstacles import Obstacles

Positions = tuple[Vector | None, ...]


@final
class ProximityReading:
    """What one agent's sensor reads, relative to the agent's own centre [m; world axes].

    vehicles: the centres of other vehicles, by agent id. obstacles: the nearest point of each
    obstacle's surface, in the order of the scenario.
    """

    def __init__(self, vehicles: tuple[Vector, ...], obstacles: tuple[Vector, ...] = ()) -> None:
        self.vehicles = vehicles
        self.obstacles = obstacles


NO_READING: Final = ProximityReading(())


class ProximitySensor:
    """Reads what is within 2 m, with normal noise per axis.

    The noise of a reading is keyed by (seed, agent, slot): it does not depend on other readings.
    """

    def __init__(self, seed: int, noise_m: float, obstacles: Obstacles) -> None:
        self.seed = seed
        self._noise_m = noise_m
        self._obstacles = obstacles
        self._index = RangeIndex(0, ())

    def read(
        self, position: Positions, agents: list[int], slot: int, time_s: float
    ) -> list[ProximityReading]:
        """Return the readings of some agents, in their order.

        position: of all vehicles [m; world frame], None for no vehicle.
        """
        if len(self._index.positions) != len(position):
            self._index = RangeIndex(len(position), tuple(range(len(position))))
        self._index.place(position)
        return [
            self._reading(
                self._vehicles(position, agent), self._points(position[agent], time_s), agent, slot
            )
            for agent in agents
        ]

    def _vehicles(self, position: Positions, agent: int) -> list[Vector]:
        """Return the vehicles near an agent [m; relative]."""
        found: list[Vector] = []
        here = position[agent]
        if here is None:
            return found
        x, y, z = here
        for row in self._index.near(agent, PROXIMITY_RANGE_M):
            there = position[row]
            if there is None or row == agent:
                continue
            a, b, c = there
            dx, dy, dz = a - x, b - y, c - z
            if dx * dx + dy * dy + dz * dz <= PROXIMITY_RANGE_M**2:
                found.append((dx, dy, dz))
        return found

    def _points(self, here: Vector | None, time_s: float) -> list[Vector]:
        """Return the nearest points of obstacles near a position [m; relative]."""
        if here is None or not len(self._obstacles):
            return []
        near = self._obstacles.near(here, time_s, PROXIMITY_RANGE_M)
        if len(near) > MAX_OBSTACLE_POINTS:
            nearest = sorted(near, key=lambda each: each[1][0])[:MAX_OBSTACLE_POINTS]
            near = sorted(nearest, key=lambda each: each[0])
        return [(-d * x, -d * y, -d * z) for _, (d, (x, y, z)) in near]

    def _reading(
        self, vehicles: list[Vector], points: list[Vector], agent: int, slot: int
    ) -> ProximityReading:
        noisy = self._with_noise(vehicles + points, agent, slot)
        return ProximityReading(noisy[: len(vehicles)], noisy[len(vehicles) :])

    def _with_noise(self, true: list[Vector], agent: int, slot: int) -> tuple[Vector, ...]:
        if self._noise_m == 0.0 or not true:
            return tuple(true)
        generator = np.random.Generator(np.random.Philox(key=[self.seed, agent << 40 | slot]))
        noisy = np.array(true) + self._noise_m * generator.standard_normal((len(true), 3))
        return tuple([(x, y, z) for x, y, z in noisy.tolist()])
