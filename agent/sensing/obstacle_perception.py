"""Obstacle perception: points of near obstacles, whichever sensors an agent carries."""

from agent.config import SCANNERS, AgentSetup, Sensors
from agent.messages import Observation, Vector
from agent.sensing.point_map import PointMap
from agent.sensing.ray_pattern import pattern_of
from agent.sensing.scan_jumps import VehicleJumps
from agent.sensing.sensor_health import PROXIMITY, SensorHealth


class ObstaclePerception:
    """Combines the proximity sensor's points with those of scanning sensors; checks both.

    sensor_health: whether the agent may trust its sensors.
    """

    def __init__(self, setup: AgentSetup) -> None:
        kinds = [kind for kind in SCANNERS if kind in setup.vehicle.sensors]
        patterns = [pattern_of(kind, setup.sensor, setup.tick_hz) for kind in kinds]
        self._map = PointMap(patterns) if patterns else None
        fastest = setup.fleet_max_speed_mps
        jumps = None
        if "proximity" in setup.vehicle.sensors:
            jumps = VehicleJumps(fastest, setup.sensor.proximity.noise_m)
        self.sensor_health = SensorHealth(
            patterns, jumps, _noisy(setup.sensor), setup.tick_hz, fastest
        )

    def near_points(self, observation: Observation, others: list[Vector]) -> tuple[Vector, ...]:
        """Return obstacle points within PROXIMITY_RANGE_M, relative [m; world axes].

        others: neighbours' positions [m; world frame]; their vehicles are no obstacles.
        """
        if self._map is None:
            return observation.obstacles
        here, now_s = observation.position, observation.time_s
        for scan in observation.scans:
            self._map.add_scan(scan, here, observation.yaw, now_s, others)
        return observation.obstacles + self._map.near_points(here, now_s)

    @property
    def scanning(self) -> bool:
        """Whether the agent carries a scanning sensor."""
        return self._map is not None


def _noisy(sensors: Sensors) -> frozenset[int]:
    """Return the sensors whose readings have noise: indices of SCANNERS, and PROXIMITY."""
    noise_m = {index: sensors.scanner(kind).noise_m for index, kind in enumerate(SCANNERS)}
    noise_m[PROXIMITY] = sensors.proximity.noise_m
    return frozenset(kind for kind, noise in noise_m.items() if noise > 0.0)
