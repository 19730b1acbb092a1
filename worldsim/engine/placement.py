"""Start poses of vehicles that enter the world after its start."""

from typing import assert_never

import numpy as np

from worldsim.engine.operations import StartPose
from worldsim.scenario.start import BoxStart, ListStart
from worldsim.scenario.tables import Scenario
from worldsim.truth.obstacles import Obstacles
from worldsim.truth.start_positions import clearance_of, start_poses
from worldsim.truth.vehicle import Floats


class Placement:
    """Draws poses from the seed, clear of obstacles and of the vehicles in the world.

    Every method takes the position of all vehicles (N, 3) [m; world frame], NaN for none, and the
    time [s], and raises StartError where there is no room.
    """

    def __init__(self, scenario: Scenario) -> None:
        self._scenario = scenario
        self._obstacles = Obstacles(scenario.obstacle)
        start = scenario.fleet.start
        self._origins = [(start, index) for index in range(scenario.fleet.agents)]
        """For each id, the start table that it was placed by and its index there."""

    def joiners(
        self, number: int, start: BoxStart | ListStart, count: int, position: Floats, time_s: float
    ) -> list[StartPose]:
        """Return the poses of the new vehicles of a join event with this number."""
        poses = self._drawn(number, start, count, position, time_s)
        self._origins += [(start, index) for index in range(count)]
        return poses

    def returning(
        self, number: int, agents: list[int], position: Floats, time_s: float
    ) -> dict[int, StartPose]:
        """Return the poses of vehicles that had left: as listed, or drawn anew from their box."""
        poses: dict[int, StartPose] = {}
        for agent in agents:
            taken = np.array([pose.position for pose in poses.values()]).reshape(-1, 3)
            present = np.concatenate((position, taken))
            start = self._start_of(agent)
            key = (number << 10) + agent
            poses[agent] = self._drawn(key, start, 1, present, time_s)[0]
        return poses

    def _start_of(self, agent: int) -> BoxStart | ListStart:
        start, index = self._origins[agent]
        match start:
            case BoxStart():
                return start
            case ListStart(positions_m=positions_m, yaws_deg=yaws_deg):
                own = slice(index, index + 1)
                own_yaw_deg = yaws_deg[own] if yaws_deg is not None else None
                return ListStart(positions_m=positions_m[own], yaws_deg=own_yaw_deg)
        assert_never(start)

    def _drawn(
        self, key: int, start: BoxStart | ListStart, count: int, position: Floats, time_s: float
    ) -> list[StartPose]:
        clearance = clearance_of(self._scenario, self._obstacles, time_s)._replace(
            vehicles=position[~np.isnan(position[:, 0])],
            vehicle_m=self._scenario.control.separation_m,
        )
        positions, yaws = start_poses(start, count, self._scenario.seed, clearance, event=key + 1)
        return [
            StartPose((x, y, z), yaw)
            for (x, y, z), yaw in zip(positions.tolist(), yaws.tolist(), strict=True)
        ]
