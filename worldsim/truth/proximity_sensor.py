"""The proximity sensor: relative positions of near vehicles and of near obstacles' surfaces."""

from math import nan
from typing import final

import numpy as np

from agent.messages import MAX_OBSTACLE_POINTS, PROXIMITY_RANGE_M, Vector
from netem.range_index import RangeIndex
from worldsim.truth.obstacles import Obstacles
from worldsim.truth.vehicle import Floats

Positions = tuple[Vector | None, ...]
NOWHERE = (nan, nan, nan)


@final
class ProximityReading:
    """What one agent's sensor reads, relative to the agent's own centre [m; world axes].

    vehicles: the centres of other vehicles, by agent id. obstacles: the nearest point of each
    obstacle's surface, in the order of the scenario.
    """

    def __init__(self, vehicles: tuple[Vector, ...], obstacles: tuple[Vector, ...] = ()) -> None:
        self.vehicles = vehicles
        self.obstacles = obstacles


NO_READING = ProximityReading(())


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
        vehicles = [self._vehicles(position, agent) for agent in agents]
        points = self._obstacle_points(position, agents, time_s) if len(self._obstacles) else None
        return [
            self._reading(near, points[row] if points is not None else None, agents[row], slot)
            for row, near in enumerate(vehicles)
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
            dx, dy, dz = there[0] - x, there[1] - y, there[2] - z
            if dx * dx + dy * dy + dz * dz <= PROXIMITY_RANGE_M**2:
                found.append((dx, dy, dz))
        return found

    def _obstacle_points(
        self, position: Positions, agents: list[int], time_s: float
    ) -> list[Floats]:
        """Return the nearest points of obstacles near each agent, (K, 3) [m; relative]."""
        points = np.array([position[agent] or NOWHERE for agent in agents])
        distance, outward = self._obstacles.nearest(points, time_s)
        found = []
        for row in range(len(agents)):
            near = np.flatnonzero(distance[row] <= PROXIMITY_RANGE_M)
            if len(near) > MAX_OBSTACLE_POINTS:
                order = np.argsort(distance[row, near], kind="stable")
                near = np.sort(near[order[:MAX_OBSTACLE_POINTS]])
            found.append(-distance[row, near, None] * outward[row, near])
        return found

    def _reading(
        self, vehicles: list[Vector], points: Floats | None, agent: int, slot: int
    ) -> ProximityReading:
        true = vehicles
        if points is not None:
            true = vehicles + [(x, y, z) for x, y, z in points.tolist()]
        noisy = self._with_noise(true, agent, slot)
        return ProximityReading(noisy[: len(vehicles)], noisy[len(vehicles) :])

    def _with_noise(self, true: list[Vector], agent: int, slot: int) -> tuple[Vector, ...]:
        if self._noise_m == 0.0 or not true:
            return tuple(true)
        generator = np.random.Generator(np.random.Philox(key=[self.seed, agent << 40 | slot]))
        noisy = np.array(true) + self._noise_m * generator.standard_normal((len(true), 3))
        return tuple([(x, y, z) for x, y, z in noisy.tolist()])
