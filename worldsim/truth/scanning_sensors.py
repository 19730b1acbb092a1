"""Scanning sensors: what laser and sonar measure.

The noise and the dropouts of one scan are keyed by (seed, agent, slot, sensor): they do not depend
on other scans.
"""

from collections.abc import Sequence
from math import cos, sin

import numpy as np

from agent.config import SCANNERS, Sensors, Vehicle
from agent.messages import NO_ECHO_MM, Scan
from agent.sensing.ray_pattern import Pattern, pattern_of
from worldsim.truth.obstacles import Obstacles
from worldsim.truth.raycast import cast, cast_at_spheres
from worldsim.truth.vehicle import Floats


class ScanningSensor:
    """One kind of scanning sensor; radius: (N,), of all vehicles [m]."""

    def __init__(
        self, pattern: Pattern, sensors: Sensors, seed: int, radius: Floats, obstacles: Obstacles
    ) -> None:
        settings = sensors.scanner(SCANNERS[pattern.kind])
        self._pattern = pattern
        self._rays = np.array(pattern.beams).reshape(-1, 3)
        self._rays_per_beam = len(pattern.beams[0])
        self._noise_m = settings.noise_m
        self._dropout = 0.01 * settings.dropout_percent
        self._seed = seed
        self._radius = radius
        self._obstacles = obstacles

    def redraw(self, seed: int) -> None:
        """Draw the noise and the dropouts of every later scan from another seed."""
        self._seed = seed

    def due(self, tick: int) -> bool:
        """Return whether the sensor scans at a tick."""
        return tick % self._pattern.every == 0

    def read(
        self, position: Floats, yaw: Floats, agents: list[int], slot: int, time_s: float
    ) -> list[Scan]:
        """Return the scans of some agents, in their order.

        position: of all vehicles (N, 3) [m; world frame], NaN for no vehicle; yaw: (N,) [rad].
        """
        ranges = self._true_ranges(position, yaw, agents, time_s)
        return [
            Scan(self._pattern.kind, self._measured(row, agent, slot))
            for row, agent in zip(ranges, agents, strict=True)
        ]

    def _true_ranges(
        self, position: Floats, yaw: Floats, agents: list[int], time_s: float
    ) -> Floats:
        """Return true ranges (P, axes) [m]; infinite beyond the sensor's range."""
        origins = position.take(agents, axis=0)
        rays = self._turned(yaw.take(agents))
        far = cast(origins, rays, self._obstacles, time_s)
        others = origins[:, None] - position
        for row, agent in enumerate(agents):
            others[row, agent] = np.nan
        far = np.minimum(far, cast_at_spheres(others, rays, self._radius))
        nearest: Floats = np.min(far.reshape(len(agents), -1, self._rays_per_beam), axis=2)
        return np.where(nearest <= self._pattern.range_m, nearest, np.inf)

    def _turned(self, yaw: Floats) -> Floats:
        """Return the rays (P, K, 3) of vehicles with given yaws (P,) [world axes]."""
        # math's cosine and sine give the same numbers for one row as for many; numpy's may not.
        c, s = np.array([[cos(a), sin(a)] for a in yaw.tolist()]).T[:, :, None]
        x, y, z = self._rays.T
        level = np.zeros(len(yaw))[:, None]
        turned = np.stack((c * x - s * y, s * x + c * y, z + level))
        return np.moveaxis(turned, 0, 2)  # each component in a row of its own, for speed

    def _measured(self, ranges: Floats, agent: int, slot: int) -> bytes:
        """Return ranges with noise and dropouts, as a Scan holds them."""
        if self._noise_m > 0.0 or self._dropout > 0.0:
            key = [self._seed, (1 + self._pattern.kind) << 62 | agent << 40 | slot]
            generator = np.random.Generator(np.random.Philox(key=key))
            ranges = ranges + self._noise_m * generator.standard_normal(ranges.shape)
            ranges = np.where(generator.random(ranges.shape) < self._dropout, np.inf, ranges)
        hits = np.isfinite(ranges)
        millimetres = np.rint(1000.0 * np.where(hits, np.maximum(ranges, 0.0), 0.0))
        measured = np.where(hits, np.minimum(millimetres, NO_ECHO_MM - 1), NO_ECHO_MM)
        return measured.astype("<u2").tobytes()


class ScanningSensors:
    """All scanning sensors of a fleet."""

    def __init__(
        self,
        vehicles: Sequence[Vehicle],
        sensors: Sensors,
        seed: int,
        tick_hz: float,
        obstacles: Obstacles,
    ) -> None:
        radius = np.array([each.radius_m for each in vehicles])
        self._carriers = [
            (
                ScanningSensor(
                    pattern_of(kind, sensors, tick_hz), sensors, seed, radius, obstacles
                ),
                frozenset(row for row, each in enumerate(vehicles) if kind in each.sensors),
            )
            for kind in SCANNERS
        ]
        """Each kind of sensor, and the agents that carry it."""
        self.any = any(carriers for _, carriers in self._carriers)
        """Whether any agent carries a scanning sensor."""

    def redraw(self, seed: int) -> None:
        """Draw the noise and the dropouts of every later scan from another seed."""
        for sensor, _ in self._carriers:
            sensor.redraw(seed)

    def read(
        self,
        position: Floats,
        yaw: Floats,
        agents: list[int],
        tick: int,
        slot: int,
        time_s: float,
    ) -> dict[int, tuple[Scan, ...]]:
        """Return the scans that some agents make in a slot, by agent; see ScanningSensor.read."""
        found: dict[int, tuple[Scan, ...]] = {}
        for sensor, carriers in self._carriers:
            rows = [agent for agent in agents if agent in carriers]
            if rows and sensor.due(tick):
                scans = sensor.read(position, yaw, rows, slot, time_s)
                for agent, scan in zip(rows, scans, strict=True):
                    found[agent] = (*found.get(agent, ()), scan)
        return found
