"""Distances and packet conservation from rows of truth, as docs/scenario.md defines them."""

from typing import Final

import numpy as np

from worldsim.judge.tick import Packets
from worldsim.truth.obstacles import Obstacles
from worldsim.truth.vehicle import Floats

MIN_SQUARE_M2: Final = 1e-300
"""The divisor used for the square of a path without length [m^2]."""
ROUNDING_M: Final = 1e-9
"""A distance this much below its bound keeps it [m]: at 1e6 m, positions are rounded to 1e-10 m."""
FATES = ("delivered", "dropped_", "in_flight")
"""Prefixes of the counters that together hold every addressed packet."""


class Separation:
    """Each vehicle's least distance to any other while both move from tick to tick."""

    def __init__(self) -> None:
        self._relative_before: Floats | None = None

    def swept(self, position: Floats) -> Floats:
        """Return the distances (N,) [m] since the previous tick; at the first tick, those now.

        position: (N, 3) [m; world frame]. Motion between ticks is taken as straight. NaN rows, and
        a vehicle that is alone, give NaN.
        """
        ends = _relative_positions(position)
        starts = self._relative_before if self._relative_before is not None else ends
        self._relative_before = ends
        back = starts - ends
        along = np.maximum(_dot(back, back), MIN_SQUARE_M2)
        when = np.minimum(np.maximum(_dot(starts, back) / along, 0.0), 1.0)
        nearest = starts - when * back
        square = _dot(nearest, nearest)
        square.flat[:: len(position) + 1] = np.nan
        least: Floats = np.fmin.reduce(square, axis=1, initial=np.nan)
        return np.sqrt(least)


def swept_obstacle_distance(
    before: Floats, after: Floats, obstacles: Obstacles, times_s: tuple[float, float]
) -> Floats:
    """Return each vehicle's least distance (N,) [m] to any of some obstacles between two ticks."""
    least: Floats = np.min(swept_obstacle_distances(before, after, obstacles, times_s), axis=1)
    return least


def swept_obstacle_distances(
    before: Floats, after: Floats, obstacles: Obstacles, times_s: tuple[float, float]
) -> Floats:
    """Return the least distances (N, M) [m], centre to surface, between two ticks.

    before, after: (N, 3) [m; world frame] at ``times_s``. Vehicles and obstacles are taken to move
    straight in between. Negative inside an obstacle; NaN where there is no vehicle.
    """
    starts = before[:, None] - obstacles.centres(times_s[0])
    ends = after[:, None] - obstacles.centres(times_s[1])
    return obstacles.swept(starts, ends)


def keeps(distance_m: float, bound_m: float) -> bool:
    """Return whether a distance [m] is no less than its bound, but for rounding."""
    return distance_m >= bound_m - ROUNDING_M


def conserved(packets: Packets) -> bool:
    """Return whether every addressed packet was delivered or dropped, or is in flight (I8)."""
    known = sum(count for name, count in packets.items() if name.startswith(FATES))
    return known == packets["addressed"]


def _relative_positions(position: Floats) -> Floats:
    """Return x, y, z of vehicle j relative to vehicle i, (3, N, N) [m; world axes]."""
    axes = position.T
    return axes[:, None, :] - axes[:, :, None]


def _dot(a: Floats, b: Floats) -> Floats:
    product = a * b
    total: Floats = product[0] + product[1] + product[2]
    return total
