"""Distances and packet conservation from rows of truth, as docs/scenario.md defines them."""

from math import inf, isnan, nan, sqrt
from typing import Final, final

import numpy as np

from agent.messages import FLIGHT_M, Vector
from netem.range_index import RangeIndex
from worldsim.judge.tick import Packets
from worldsim.truth.obstacles import Obstacles
from worldsim.truth.vehicle import Floats, array_of

MIN_SQUARE_M2: Final = 1e-300
"""The divisor used for the square of a path without length [m^2]."""
ROUNDING_M: Final = 1e-9
"""A distance this much below its bound keeps it [m]: at 1e6 m, positions are rounded to 1e-10 m."""
FIRST_WITHIN_M: Final = 2.0
"""Within this distance, a vehicle of a large fleet is searched for its nearest first [m]."""
LAST_WITHIN_M: Final = 4.0 * FLIGHT_M
"""No two vehicles are so far apart [m]."""
FATES: Final = ("delivered", "dropped_", "in_flight")
"""Prefixes of the counters that together hold every addressed packet."""


@final
class Separation:
    """Each vehicle's least distance to any other while both move from tick to tick."""

    def __init__(self) -> None:
        self._index = RangeIndex(0, ())
        self._before: list[Vector] | None = None

    def swept(self, position: Floats) -> Floats:
        """Return the distances (N,) [m] since the previous tick; at the first tick, those now.

        position: (N, 3) [m; world frame]. Motion between ticks is taken as straight. NaN rows, and
        a vehicle that is alone, give NaN.
        """
        after: list[Vector] = [(x, y, z) for x, y, z in position.tolist()]
        sweep = _Sweep(self._before if self._before is not None else after, after)
        self._before = after
        self._place(after)
        everyone, searched = list(range(len(after))), 0
        for row in everyone:
            near = self._index.near(row, FIRST_WITHIN_M)
            searched += len(near)
            if len(near) == len(after):
                sweep.take(row, everyone[row + 1 :])
            else:
                sweep.take(row, [other for other in near if other > row])
        if searched < len(after) ** 2:
            for row in everyone:
                self._search_farther(sweep, row)
        return array_of([sqrt(square) if square < inf else nan for square in sweep.square])

    def _search_farther(self, sweep: "_Sweep", row: int) -> None:
        """Search a vehicle's nearest in wider and wider circles, as far as it takes."""
        within_m = FIRST_WITHIN_M
        while sweep.may_be_farther(row, within_m) and within_m < LAST_WITHIN_M:
            within_m *= 2.0
            near = self._index.near(row, within_m)
            sweep.take(row, [other for other in near if other != row])

    def _place(self, position: list[Vector]) -> None:
        if len(self._index.positions) != len(position):
            self._index = RangeIndex(len(position), tuple(range(len(position))))
        self._index.place(tuple([None if isnan(each[0]) else each for each in position]))


@final
class _Sweep:
    """The motion of all vehicles from one tick to the next, and how near others come to each.

    before, after: row i = vehicle i [m; world frame].
    """

    def __init__(self, before: list[Vector], after: list[Vector]) -> None:
        self._before, self._after = before, after
        self.square: list[float] = [inf] * len(after)
        """Of the least distance so far [m^2]; infinite before any."""
        self._longest_way_m = _longest_way_m(before, after)

    def take(self, row: int, others: list[int]) -> None:
        """Take how near a vehicle and others come to each other."""
        x, y, z = self._before[row]
        to_x, to_y, to_z = self._after[row]
        square = self.square
        least = square[row]
        for other in others:
            a, b, c = self._before[other]
            to_a, to_b, to_c = self._after[other]
            u, v, w = a - x, b - y, c - z
            back_u, back_v, back_w = u - (to_a - to_x), v - (to_b - to_y), w - (to_c - to_z)
            along = back_u * back_u + back_v * back_v + back_w * back_w
            along = along if along > MIN_SQUARE_M2 else MIN_SQUARE_M2
            when = (u * back_u + v * back_v + w * back_w) / along
            when = 0.0 if when < 0.0 else 1.0 if when > 1.0 else when
            u, v, w = u - when * back_u, v - when * back_v, w - when * back_w
            found = u * u + v * v + w * w
            least = min(least, found)
            square[other] = min(square[other], found)
        square[row] = least

    def may_be_farther(self, row: int, within_m: float) -> bool:
        """Return whether a vehicle's nearest may be none of those within a distance [m] now.

        Two vehicles that are farther apart now were no nearer than both ways allow.
        """
        surely_m = within_m - 2.0 * self._longest_way_m - ROUNDING_M
        found = surely_m > 0.0 and self.square[row] <= surely_m * surely_m
        return not found and not isnan(self._after[row][0])


def swept_obstacle_distance(
    before: Floats, after: Floats, obstacles: Obstacles, times_s: tuple[float, float]
) -> Floats:
    """Return each vehicle's least distance (N,) [m] to any of some obstacles between two ticks.

    before, after: (N, 3) [m; world frame] at ``times_s``. Vehicles and obstacles are taken to move
    straight in between. Negative inside an obstacle; NaN where there is no vehicle.
    """
    start, end = obstacles.relative(before, times_s[0]), obstacles.relative(after, times_s[1])
    least: Floats = np.min(obstacles.swept(start, end), axis=1)
    return least


def keeps(distance_m: float, bound_m: float) -> bool:
    """Return whether a distance [m] is no less than its bound, but for rounding."""
    return distance_m >= bound_m - ROUNDING_M


def conserved(packets: Packets) -> bool:
    """Return whether every addressed packet was delivered or dropped, or is in flight (I8)."""
    known = 0
    for name, count in packets.items():
        if name.startswith(FATES):
            known += count
    return known == packets["addressed"]


def _longest_way_m(before: list[Vector], after: list[Vector]) -> float:
    """Return how far a vehicle has moved at most [m]."""
    longest = 0.0
    for row, (to_x, to_y, to_z) in enumerate(after):
        x, y, z = before[row]
        u, v, w = to_x - x, to_y - y, to_z - z
        longest = max(longest, u * u + v * v + w * w)
    return sqrt(longest)
