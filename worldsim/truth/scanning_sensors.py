"""What scanning sensors tell: laser and sonar, for all that look at once.

The noise and the dropouts of one scan are keyed by (seed, agent, slot, sensor): they do not depend
on who else looks.
"""

from collections.abc import Sequence
from math import cos, sin

import numpy as np

from agent.config import Sensors, Vehicle
from agent.messages import NO_ECHO_MM, Scan
from agent.sensing.ray_pattern import SCANNERS, Pattern, pattern_of
from worldsim.truth.obstacles import Obstacles
from worldsim.truth.raycast import cast, cast_at_spheres
from worldsim.truth.vehicle import Floats


class Scanner:
    """One kind of sensor, on those agents that carry it."""

    def __init__(
        self, pattern: Pattern, sensors: Sensors, seed: int, bodies: Floats, obstacles: Obstacles
    ) -> None:
        settings = sensors.laser if pattern.kind == 0 else sensors.sonar
        self._pattern = pattern
        self._rays = np.array(pattern.beams).reshape(-1, 3)
        self._in_beam = len(pattern.beams[0])
        self._noise_m = settings.noise_m
        self._dropout = 0.01 * settings.dropout_percent
        self._seed = seed
        self._bodies = bodies
        self._obstacles = obstacles

    def due(self, tick: int) -> bool:
        """Whether it scans at a tick."""
        return tick % self._pattern.every == 0

    def read(
        self, position: Floats, yaw: Floats, looking: list[int], slot: int, time_s: float
    ) -> list[Scan]:
        """Return the scan of each agent in ``looking``.

        position (N, 3) [m; world frame], NaN for no vehicle; yaw (N,) [rad].
        """
        ranges = self.ranges(position, yaw, looking, time_s)
        return [
            Scan(self._pattern.kind, self._told(row, agent, slot))
            for row, agent in zip(ranges, looking, strict=True)
        ]

    def ranges(self, position: Floats, yaw: Floats, looking: list[int], time_s: float) -> Floats:
        """Return true ranges (P, axes) [m] of those who look; infinite beyond the sensor's."""
        origins = position.take(looking, axis=0)
        rays = self._turned(yaw.take(looking))
        far = cast(origins, rays, self._obstacles, time_s)
        others = origins[:, None] - position
        for row, agent in enumerate(looking):
            others[row, agent] = np.nan
        far = np.minimum(far, cast_at_spheres(others, rays, self._bodies))
        nearest: Floats = np.min(far.reshape(len(looking), -1, self._in_beam), axis=2)
        return np.where(nearest <= self._pattern.range_m, nearest, np.inf)

    def _turned(self, yaw: Floats) -> Floats:
        # By math's cosine and sine, which are the same for one row as for many.
        c, s = np.array([[cos(a), sin(a)] for a in yaw.tolist()]).T[:, :, None]
        x, y, z = self._rays.T
        level = np.zeros(len(yaw))[:, None]
        return np.stack((c * x - s * y, s * x + c * y, z + level), axis=2)

    def _told(self, ranges: Floats, agent: int, slot: int) -> bytes:
        if self._noise_m > 0.0 or self._dropout > 0.0:
            key = [self._seed, (1 + self._pattern.kind) << 62 | agent << 40 | slot]
            generator = np.random.Generator(np.random.Philox(key=key))
            ranges = ranges + self._noise_m * generator.standard_normal(ranges.shape)
            ranges = np.where(generator.random(ranges.shape) < self._dropout, np.inf, ranges)
        met = np.isfinite(ranges)
        millimetres = np.rint(1000.0 * np.where(met, np.maximum(ranges, 0.0), 0.0))
        told = np.where(met, np.minimum(millimetres, NO_ECHO_MM - 1), NO_ECHO_MM)
        return told.astype("<u2").tobytes()


class Scans:
    """All scanning sensors of a fleet."""

    def __init__(
        self,
        vehicles: Sequence[Vehicle],
        sensors: Sensors,
        seed: int,
        tick_hz: float,
        obstacles: Obstacles,
    ) -> None:
        bodies = np.array([each.radius_m for each in vehicles])
        self._carriers = [
            (
                Scanner(pattern_of(kind, sensors, tick_hz), sensors, seed, bodies, obstacles),
                frozenset(row for row, each in enumerate(vehicles) if kind in each.sensors),
            )
            for kind in SCANNERS
        ]
        self.any = any(carriers for _, carriers in self._carriers)

    def read(
        self,
        position: Floats,
        yaw: Floats,
        looking: list[int],
        tick: int,
        slot: int,
        time_s: float,
    ) -> dict[int, tuple[Scan, ...]]:
        """Return the scans made in a slot by those who look, by agent."""
        found: dict[int, tuple[Scan, ...]] = {}
        for scanner, carriers in self._carriers:
            rows = [agent for agent in looking if agent in carriers]
            if rows and scanner.due(tick):
                read = scanner.read(position, yaw, rows, slot, time_s)
                for agent, scan in zip(rows, read, strict=True):
                    found[agent] = (*found.get(agent, ()), scan)
        return found
