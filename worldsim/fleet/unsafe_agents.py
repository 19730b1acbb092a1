"""Whether safety was broken by agents that were on time, on a host that made others late.

An agent that is late, or whose neighbour is, may not have known what it needed to keep clear.
"""

from collections.abc import Callable

import numpy as np

from worldsim.judge.verdict import Figures

ON_TIME_FOR_S = 1.0
"""An agent is on time that has answered in time for so long [s; simulated time]."""


class UnsafeAgents:
    """Looks at every tick for vehicles that are too near to each other, or to an obstacle.

    separation_m, obstacle_m: the bounds [m].
    """

    def __init__(self, separation_m: float, obstacle_m: float) -> None:
        self.on_time = False
        """Whether agents that were on time have broken safety."""
        self._separation_m, self._obstacle_m = separation_m, obstacle_m
        self._seen: Figures | None = None

    def see(self, figures: Figures | None, is_on_time: Callable[[int], bool]) -> None:
        """Take the newest figures, each once. is_on_time: whether an agent has been so lately."""
        if figures is None or figures is self._seen:
            return
        self._seen = figures
        near = np.flatnonzero(figures.separation < self._separation_m).tolist()
        # The two that are near each other are both among them.
        if len(near) >= 2 and sum(map(is_on_time, near)) >= 2:
            self.on_time = True
        if figures.obstacle_distance is not None:
            at_obstacle = np.flatnonzero(figures.obstacle_distance < self._obstacle_m).tolist()
            self.on_time = self.on_time or any(map(is_on_time, at_obstacle))
