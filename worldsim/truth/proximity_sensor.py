"""The proximity sensor: relative positions of near vehicles and of near obstacles' surfaces."""

from typing import Final, final

import numpy as np

from agent.messages import MAX_OBSTACLE_POINTS, PROXIMITY_RANGE_M, Vector
from worldsim.truth.obstacles import Obstacles
from worldsim.truth.vehicle import Floats

ARRAYS_FROM: Final = 40
"""Number of vehicles from which arrays are faster."""


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

    def read(
        self, position: Floats, agents: list[int], slot: int, time_s: float
    ) -> list[ProximityReading]:
        """Return the readings of some agents, in their order.

        position: of all vehicles (N, 3) [m; world frame], NaN for no vehicle.
        """
        vehicles = self._vehicles(position, agents)
        points = self._obstacle_points(position, agents, time_s) if len(self._obstacles) else None
        return [
            self._reading(near, points[row] if points is not None else None, agents[row], slot)
            for row, near in enumerate(vehicles)
        ]

    def _vehicles(self, position: Floats, agents: list[int]) -> list[list[Vector]]:
        """Return the vehicles near each agent [m; relative].

        Small fleets are searched in a loop over plain floats, large ones as arrays, by the same
        operations.
        """
        if len(position) < ARRAYS_FROM:
            rows: list[Vector] = list(map(tuple, position.tolist()))
            return [_vehicles_by_loop(rows, agent) for agent in agents]
        relative = position - position.take(agents, axis=0)[:, None]
        square = relative * relative
        near = square[:, :, 0] + square[:, :, 1] + square[:, :, 2] <= PROXIMITY_RANGE_M**2
        near[np.arange(len(agents)), agents] = False
        return [
            [(x, y, z) for x, y, z in relative[row, near[row]].tolist()]
            for row in range(len(agents))
        ]

    def _obstacle_points(self, position: Floats, agents: list[int], time_s: float) -> list[Floats]:
        """Return the nearest points of obstacles near each agent, (K, 3) [m; relative]."""
        distance, outward = self._obstacles.nearest(position.take(agents, axis=0), time_s)
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


def _vehicles_by_loop(rows: list[Vector], agent: int) -> list[Vector]:
    x, y, z = rows[agent]
    near: list[Vector] = []
    for row, (a, b, c) in enumerate(rows):
        dx, dy, dz = a - x, b - y, c - z
        if dx * dx + dy * dy + dz * dz <= PROXIMITY_RANGE_M**2 and row != agent:
            near.append((dx, dy, dz))
    return near
