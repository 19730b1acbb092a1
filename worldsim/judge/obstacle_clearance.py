"""Distances from vehicles to obstacles: centre to surface, swept from tick to tick."""

from math import inf

import numpy as np

from worldsim.judge.metrics import swept_obstacle_distance
from worldsim.judge.tick import Tick
from worldsim.scenario.tables import Scenario
from worldsim.truth.obstacles import Obstacles
from worldsim.truth.vehicle import Floats


class ObstacleClearance:
    """Measures the obstacle distances of a run; false where the scenario has no obstacles."""

    def __init__(self, scenario: Scenario) -> None:
        self._obstacles = Obstacles(scenario.obstacle)
        self.bound_m = scenario.obstacle_bound_m
        self.least_m: float | None = None
        """The least distance so far [m]; None while nothing was measured."""

    def __bool__(self) -> bool:
        return len(self._obstacles) > 0

    def see(self, before: Tick, tick: Tick) -> tuple[Floats, bool]:
        """Return each vehicle's least distance (N,) [m] between ticks, and whether one is too near.

        Too near is less than ``bound_m``.
        """
        times_s = (before.time_s, tick.time_s)
        distance = swept_obstacle_distance(before.position, tick.position, self._obstacles, times_s)
        least = float(np.fmin.reduce(distance, initial=np.inf))
        if least < inf and (self.least_m is None or least < self.least_m):
            self.least_m = least
        return distance, least < self.bound_m
