"""What an agent sees of obstacles, whichever sensors it carries."""

from agent.config import AgentSetup, Sensors
from agent.messages import Observation, Vector
from agent.sensing.point_map import PointMap
from agent.sensing.ray_pattern import KINDS, pattern_of
from agent.sensing.sensor_health import PROXIMITY, SensorHealth


class ObstaclePerception:
    """Turns scans into points near by; without sensors that scan, the proximity sensor's."""

    def __init__(self, setup: AgentSetup) -> None:
        kinds = [kind for kind in KINDS if kind in setup.vehicle.sensors]
        patterns = [pattern_of(kind, setup.sensor, setup.tick_hz) for kind in kinds]
        self._map = PointMap(patterns) if patterns else None
        ranging = "proximity" in setup.vehicle.sensors
        self.trust = SensorHealth(
            patterns, ranging, _noisy(setup.sensor), setup.tick_hz, setup.fleet_max_speed_mps
        )

    def near(self, observation: Observation, others: list[Vector]) -> tuple[Vector, ...]:
        """Return points of obstacles within 2 m, relative [m; world axes].

        others: where neighbours are [m; world frame]; their bodies are no obstacles.
        """
        if self._map is None:
            return observation.obstacles
        here, now_s = observation.position, observation.time_s
        for scan in observation.scans:
            self._map.take(scan, here, observation.yaw, now_s, others)
        return observation.obstacles + self._map.near(here, now_s)

    @property
    def scanning(self) -> bool:
        """Whether there is a sensor that scans."""
        return self._map is not None


def _noisy(sensors: Sensors) -> frozenset[int]:
    """Return the sensors whose readings have noise: kinds of scans, and PROXIMITY."""
    noise_m = {
        PROXIMITY: sensors.proximity.noise_m,
        KINDS.index("laser"): sensors.laser.noise_m,
        KINDS.index("sonar"): sensors.sonar.noise_m,
    }
    return frozenset(kind for kind, noise in noise_m.items() if noise > 0.0)
