"""Distances and angles, from rows of truth. Definitions are those of the README."""

import numpy as np
from numpy.typing import NDArray

from worldsim.judge.tick import Packets, Singles
from worldsim.truth.obstacles import Obstacles

LEAST_M2 = 1e-300
"""Stands for the square of no motion at all, by which nothing can be divided [m^2]."""
Floats = NDArray[np.float64]


class Separation:
    """Each vehicle's least distance to any other while both move from tick to tick."""

    def __init__(self) -> None:
        self._between: Floats | None = None

    def swept(self, position: Singles) -> Floats:
        """Return the distances (N,) [m] since the tick before, of which there is none at first.

        position: (N, 3) [m]; motion between ticks is taken as straight. NaN rows, and a vehicle
        that is alone, give NaN.
        """
        ends = _between_rows(position)
        starts = self._between if self._between is not None else ends
        self._between = ends
        back = starts - ends
        along = np.maximum(_dot(back, back), LEAST_M2)
        when = np.minimum(np.maximum(_dot(starts, back) / along, 0.0), 1.0)
        nearest = starts - when * back
        square = _dot(nearest, nearest)
        square.flat[:: len(position) + 1] = np.nan
        least: Floats = np.fmin.reduce(square, axis=1, initial=np.nan)
        return np.sqrt(least)


def swept_obstacle_distance(
    before: Floats, after: Floats, obstacles: Obstacles, times_s: tuple[float, float]
) -> Floats:
    """Return each vehicle's least distance, centre to surface, from tick to tick [m].

    before, after: (N, 3) [m; world frame] at ``times_s``; vehicles and obstacles are taken to move
    straight between. Negative within an obstacle; NaN for no vehicle.
    """
    starts = before[:, None] - obstacles.centres(times_s[0])
    ends = after[:, None] - obstacles.centres(times_s[1])
    least: Floats = np.min(obstacles.swept(starts, ends), axis=1)
    return least


def conserved(packets: Packets) -> bool:
    """Whether every packet addressed was delivered, or dropped, or is in flight (I8)."""
    whereabouts = ("delivered", "dropped_", "in_flight")
    known = sum(count for name, count in packets.items() if name.startswith(whereabouts))
    return known == packets["addressed"]


def _between_rows(position: Singles) -> Floats:
    """Return x, y, z of row j as seen from row i, (3, N, N) [m]."""
    axes: Floats = position.T.astype(np.float64)
    return axes[:, None, :] - axes[:, :, None]


def _dot(a: Floats, b: Floats) -> Floats:
    product = a * b
    total: Floats = product[0] + product[1] + product[2]
    return total
