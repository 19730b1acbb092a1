"""What agents sense, kept for a recording: the points that their sensors tell them of."""

from array import array
from collections.abc import Sequence
from dataclasses import dataclass, field

from agent.config import SCANNERS
from agent.messages import NO_ECHO_MM, Observation, Scan, Vector
from agent.sensing.ray_pattern import Pattern, pattern_of
from agent.vectors import length, turned
from worldsim.judge.tick import Tick
from worldsim.scenario.tables import SLOTS_PER_TICK, Scenario

MAX_POINTS = 12
"""Of what an agent senses, so many of the nearest points are shown."""


@dataclass(frozen=True, slots=True)
class Sensed:
    """What one agent senses: points relative to its vehicle [m; world axes], the nearest first."""

    vehicles: list[Vector] = field(default_factory=list)
    surfaces: list[Vector] = field(default_factory=list)


class SensedPoints:
    """Keeps the observations of the ticks that are shown; every: one tick of so many is."""

    def __init__(self, scenario: Scenario, every: int) -> None:
        self._every = every
        self._slots = SLOTS_PER_TICK
        kinds = {kind for vehicle in scenario.vehicles for kind in vehicle.sensors}
        patterns = [
            pattern_of(kind, scenario.sensor, scenario.fleet.tick_hz)
            for kind in SCANNERS
            if kind in kinds
        ]
        self._patterns = {pattern.kind: pattern for pattern in patterns}
        self._kept: dict[int, dict[int, Observation]] = {}
        """By tick and agent."""
        self._scans: dict[int, tuple[Scan, ...]] = {}
        """Of each agent, the newest."""

    def keep(self, observations: Sequence[tuple[int, Observation]]) -> None:
        """Keep the observations of some agents, where their tick is shown."""
        for agent, observation in observations:
            tick = observation.slot // self._slots
            if observation.scans:
                self._scans[agent] = observation.scans
            if tick % self._every == 0:
                self._kept.setdefault(tick, {})[agent] = observation

    def take(self, tick: Tick) -> dict[int, Sensed]:
        """Return what running agents sense at a tick, and forget it and all before it."""
        found = self._kept.get(tick.index, {})
        self._kept = {index: rows for index, rows in self._kept.items() if index > tick.index}
        yaws = tick.attitude[:, 0].tolist()
        return {
            agent: Sensed(
                _nearest(observation.vehicles),
                _nearest([*observation.obstacles, *self._echoes(agent, yaws[agent])]),
            )
            for agent, observation in sorted(found.items())
            if tick.alive[agent]
        }

    def _echoes(self, agent: int, yaw: float) -> list[Vector]:
        return [
            point
            for scan in self._scans.get(agent, ())
            if scan.kind in self._patterns
            for point in _points_of(scan, self._patterns[scan.kind], yaw)
        ]


def _points_of(scan: Scan, pattern: Pattern, yaw: float) -> list[Vector]:
    """Return the echoes of a scan as points [m; world axes]; yaw: the vehicle's heading [rad]."""
    ranges = array("H", scan.ranges)
    echoes = [
        (0.001 * far * x, 0.001 * far * y, 0.001 * far * z)
        for far, (x, y, z) in zip(ranges, pattern.axes, strict=True)
        if far != NO_ECHO_MM
    ]
    return turned(echoes, yaw)


def _nearest(points: Sequence[Vector]) -> list[Vector]:
    return sorted(points, key=length)[:MAX_POINTS]
