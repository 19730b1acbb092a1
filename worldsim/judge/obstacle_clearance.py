"""How near vehicles come to obstacles: centre to surface, swept from tick to tick."""

from math import inf

import numpy as np

from worldsim.judge.metrics import swept_obstacle_distance
from worldsim.judge.tick import Tick
from worldsim.scenario.tables import Scenario
from worldsim.truth.obstacles import Obstacles
from worldsim.truth.vehicle import Floats


class Clearance:
    """Watches a whole run; ``least_m`` is None as long as nothing could be measured."""

    def __init__(self, scenario: Scenario) -> None:
        self.bound_m = scenario.obstacle_bound_m
        self.obstacles = Obstacles(scenario.obstacle)
        self.least_m: float | None = None

    def __bool__(self) -> bool:
        return len(self.obstacles) > 0

    def see(self, before: Tick, tick: Tick) -> tuple[Floats, bool]:
        """Return each vehicle's least distance (N,) [m] since the tick before, and a breach."""
        starts, ends = before.position.astype(np.float64), tick.position.astype(np.float64)
        times = (before.time_s, tick.time_s)
        distance = swept_obstacle_distance(starts, ends, self.obstacles, times)
        least = float(np.fmin.reduce(distance, initial=np.inf))
        if least < inf and (self.least_m is None or least < self.least_m):
            self.least_m = least
        return distance, least < self.bound_m
