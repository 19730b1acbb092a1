"""What vehicles sense of one another and of obstacles near by, for all that look at once."""

import msgspec
import numpy as np

from agent.messages import MAX_OBSTACLE_POINTS, PROXIMITY_RANGE_M, Vector
from worldsim.truth.obstacles import Obstacles
from worldsim.truth.vehicle import Floats

LARGE = 40
"""From so many vehicles on, arrays are quicker."""


class Sensed(msgspec.Struct, frozen=True, gc=False):
    """Bodies and nearest points of obstacles, relative to the own centre [m; world axes]."""

    vehicles: tuple[Vector, ...]
    obstacles: tuple[Vector, ...] = ()


class ProximitySensor:
    """True relative positions of what is within 2 m, with normal noise per axis [m].

    Of each vehicle it gives the centre, of each obstacle the nearest point of the surface.

    The noise of one reading is keyed by (seed, agent, slot): it does not depend on who else looks.
    """

    def __init__(self, seed: int, noise_m: float, obstacles: Obstacles) -> None:
        self.seed = seed
        self._noise_m = noise_m
        self._obstacles = obstacles

    def read(self, position: Floats, looking: list[int], slot: int, time_s: float) -> list[Sensed]:
        """Return what each agent in ``looking`` senses.

        position: (N, 3) [m; world frame], NaN for no vehicle. Order of bodies: by agent's row; of
        obstacles: as in the scenario.
        """
        bodies = self._bodies(position, looking)
        points = self._points(position, looking, time_s) if len(self._obstacles) else None
        return [
            self._sensed(body, points[row] if points is not None else None, looking[row], slot)
            for row, body in enumerate(bodies)
        ]

    def _bodies(self, position: Floats, looking: list[int]) -> list[list[Vector]]:
        """Return the vehicles near each who looks [m; relative].

        Small fleets are walked through in plain floats, large ones as arrays, by the same steps.
        """
        if len(position) < LARGE:
            rows = position.tolist()
            return [_walked(rows, agent) for agent in looking]
        relative = position - position.take(looking, axis=0)[:, None]
        square = relative * relative
        near = square[:, :, 0] + square[:, :, 1] + square[:, :, 2] <= PROXIMITY_RANGE_M**2
        near[np.arange(len(looking)), looking] = False
        return [
            [(x, y, z) for x, y, z in relative[row, near[row]].tolist()]
            for row in range(len(looking))
        ]

    def _points(self, position: Floats, looking: list[int], time_s: float) -> list[Floats]:
        """Return the nearest points of obstacles near each who looks, (K, 3) [m; relative]."""
        distance, away = self._obstacles.nearest(position.take(looking, axis=0), time_s)
        found = []
        for row in range(len(looking)):
            near = np.flatnonzero(distance[row] <= PROXIMITY_RANGE_M)
            if len(near) > MAX_OBSTACLE_POINTS:
                order = np.argsort(distance[row, near], kind="stable")
                near = np.sort(near[order[:MAX_OBSTACLE_POINTS]])
            found.append(-distance[row, near, None] * away[row, near])
        return found

    def _sensed(self, bodies: list[Vector], points: Floats | None, agent: int, slot: int) -> Sensed:
        if points is not None:
            bodies = bodies + [(x, y, z) for x, y, z in points.tolist()]
        told = self._told(bodies, agent, slot)
        vehicles = len(told) - (len(points) if points is not None else 0)
        return Sensed(told[:vehicles], told[vehicles:])

    def _told(self, sensed: list[Vector], agent: int, slot: int) -> tuple[Vector, ...]:
        if self._noise_m == 0.0 or not sensed:
            return tuple(sensed)
        generator = np.random.Generator(np.random.Philox(key=[self.seed, agent << 40 | slot]))
        noisy = np.array(sensed) + self._noise_m * generator.standard_normal((len(sensed), 3))
        return tuple([(x, y, z) for x, y, z in noisy.tolist()])


def _walked(rows: list[list[float]], agent: int) -> list[Vector]:
    x, y, z = rows[agent]
    near: list[Vector] = []
    for row, (a, b, c) in enumerate(rows):
        dx, dy, dz = a - x, b - y, c - z
        if dx * dx + dy * dy + dz * dz <= PROXIMITY_RANGE_M**2 and row != agent:
            near.append((dx, dy, dz))
    return near
