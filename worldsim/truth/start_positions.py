"""Where vehicles start: positions and headings, drawn from the seed or listed."""

from typing import NamedTuple

import numpy as np

from worldsim.scenario.start import BoxStart, ListStart
from worldsim.scenario.tables import Scenario
from worldsim.truth.obstacles import Obstacles
from worldsim.truth.vehicle import Floats, Poses

MAX_DRAWS = 10_000
"""Draws for the vehicles of a box, besides DRAWS_EACH for each, after which it counts as full."""
DRAWS_EACH = 20
KEY_SALT = 0x57A27
NO_VEHICLES: Floats = np.empty((0, 3))


class StartError(ValueError):
    """There is no room for a start; the text says where or why."""


class Clearance(NamedTuple):
    """What a starting vehicle must stay clear of."""

    obstacles: Obstacles
    obstacle_m: float
    """Least distance from the vehicle's centre to a surface [m]."""
    time_s: float = 0.0
    """Time of the start: obstacles move [s]."""
    vehicles: Floats = NO_VEHICLES
    """Positions (K, 3) of the vehicles that are present [m; world frame]."""
    vehicle_m: float = 0.0
    """Least distance from them where positions are listed [m]; a box has its own spacing_m."""

    def obstacle_near(self, place: Floats) -> int | None:
        """Return an obstacle that is too near to a place (3,) [m; world frame], or None."""
        if not len(self.obstacles):
            return None
        distance = self.obstacles.nearest(place.reshape(1, 3), self.time_s).distance[0]
        near = np.flatnonzero(distance < self.obstacle_m)
        return int(near[0]) if len(near) else None


NO_CLEARANCE = Clearance(Obstacles(()), 0.0)


def clearance_of(scenario: Scenario, obstacles: Obstacles, time_s: float = 0.0) -> Clearance:
    """Return the clearance that a scenario's vehicles keep from obstacles at a time [s]."""
    return Clearance(obstacles, scenario.obstacle_bound_m, time_s)


def start_poses_of(scenario: Scenario, obstacles: Obstacles) -> Poses:
    """Return the poses of a scenario's fleet at the start of a run, or raise StartError."""
    clearance = clearance_of(scenario, obstacles)
    return start_poses(scenario.fleet.start, scenario.fleet.agents, scenario.seed, clearance)


def start_poses(
    start: BoxStart | ListStart,
    agents: int,
    seed: int,
    clearance: Clearance = NO_CLEARANCE,
    event: int = 0,
) -> Poses:
    """Return the poses of ``agents`` vehicles, or raise StartError.

    event: number that makes draws of one seed differ; 0 at the start of a run.
    """
    if isinstance(start, ListStart):
        yaws = start.yaws_deg if start.yaws_deg is not None else (0.0,) * agents
        return Poses(_listed(np.array(start.positions_m), clearance), np.radians(np.array(yaws)))
    generator = np.random.Generator(np.random.Philox(key=[seed, event << 20 | KEY_SALT]))
    position = _drawn(start, agents, generator, clearance)
    return Poses(position, generator.uniform(-np.pi, np.pi, agents))


def _listed(positions: Floats, clearance: Clearance) -> Floats:
    for x, y, z in positions.tolist():
        near = clearance.obstacle_near(np.array((x, y, z)))
        if near is not None:
            raise StartError(
                f"obstacle[{near}] is within {clearance.obstacle_m:g} m of [{x:g}, {y:g}, {z:g}]"
            )
        if not _apart(clearance.vehicles - (x, y, z), clearance.vehicle_m):
            raise StartError(
                f"a vehicle is within {clearance.vehicle_m:g} m of [{x:g}, {y:g}, {z:g}]"
            )
    return positions


def _drawn(
    start: BoxStart, agents: int, generator: np.random.Generator, clearance: Clearance
) -> Floats:
    centre, size = np.array(start.centre_m), np.array(start.size_m)
    present = clearance.vehicles
    placed = np.concatenate((present, np.empty((agents, 3))))
    row = len(present)
    for _ in range(MAX_DRAWS + DRAWS_EACH * agents):
        if row == len(placed):
            return placed[len(present) :]
        placed[row] = centre + size * (generator.random(3) - 0.5)
        apart = _apart(placed[:row] - placed[row], start.spacing_m)
        if apart and clearance.obstacle_near(placed[row]) is None:
            row += 1
    raise StartError(_box_is_full(start, agents, clearance))


def _box_is_full(start: BoxStart, agents: int, clearance: Clearance) -> str:
    size = " x ".join(f"{edge:g}" for edge in start.size_m)
    far = f", {clearance.obstacle_m:g} m from obstacles" if len(clearance.obstacles) else ""
    return f"no room for {agents} agents {start.spacing_m:g} m apart in a box of {size} m{far}"


def _apart(away: Floats, least_m: float) -> bool:
    return bool(np.all(np.sqrt(np.sum(away * away, axis=1)) >= least_m))
