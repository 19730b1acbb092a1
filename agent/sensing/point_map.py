"""A map of scanned points: what a narrow sensor saw stays known while it looks elsewhere.

The map is a grid of cubes, each with its last point. It forgets a point that was not seen again for
some seconds, and a point that a later ray passes through: vehicles move on and leave no wall.
"""

from array import array
from collections.abc import Sequence
from math import atan2, cos, hypot, inf, pi, sqrt
from typing import Final

from agent.messages import NO_ECHO_MM, PROXIMITY_RANGE_M, Scan, Vector
from agent.sensing.ray_pattern import Grid, Pattern
from agent.vectors import turned

KEPT_S: Final = 6.0
CUBE_M: Final = 0.15
MAX_NEAR_POINTS: Final = 24
MAX_POINTS: Final = 2000
PASSED_M: Final = 0.3
"""An echo from this much farther than a point shows that the point is gone."""
MISSES: Final = 2
"""So many rays without an echo show it too; a single one may be a dropout."""
NEIGHBOUR_RADIUS_M: Final = 0.3
"""An echo that may come from nearer than this to a neighbour's reported position is its echo."""

Cube = tuple[int, int, int]


class MapPoint:
    """A scanned point."""

    __slots__ = ("at", "misses", "seen_s")

    def __init__(self, at: Vector, seen_s: float) -> None:
        self.at = at  # [m; world frame]
        self.seen_s = seen_s  # last seen [s]
        self.misses = 0  # rays through it without an echo since


class PointMap:
    """The points that one agent's scanning sensors saw."""

    def __init__(self, patterns: Sequence[Pattern]) -> None:
        self._patterns = {pattern.kind: pattern for pattern in patterns}
        self._points: dict[Cube, MapPoint] = {}

    def __len__(self) -> int:
        return len(self._points)

    def add_scan(
        self, scan: Scan, here: Vector, yaw: float, now_s: float, others: Sequence[Vector] = ()
    ) -> None:
        """Add a scan made at a pose [m, rad; world frame]; others: neighbours' positions [m].

        A scan of a sensor that the agent does not carry, or of another length, is ignored.
        """
        pattern = self._patterns.get(scan.kind)
        ranges = array("H", scan.ranges) if len(scan.ranges) % 2 == 0 else array("H")
        if pattern is None or len(ranges) != len(pattern.axes):
            return
        self._forget_old(now_s)
        axes = turned(pattern.axes, yaw)
        if pattern.grid is not None:
            self._clear_passed(pattern.grid, ranges, pattern.range_m, here, yaw)
        x, y, z = here
        near = [(u - x, v - y, w - z) for u, v, w in others]
        for axis, millimetres in zip(axes, ranges, strict=True):
            if millimetres != NO_ECHO_MM:
                away_m = 0.001 * millimetres
                if not _is_of_any(near, axis, away_m, pattern.half):
                    self._add_point(here, axis, away_m, now_s)

    def near_points(self, here: Vector, now_s: float) -> tuple[Vector, ...]:
        """Return the points within PROXIMITY_RANGE_M of a position, nearest first.

        They are relative to it [m; world axes], and at most MAX_NEAR_POINTS: a surface may be
        seen as many points.
        """
        x, y, z = here
        found = []
        for point in self._points.values():
            u, v, w = point.at
            u, v, w = u - x, v - y, w - z
            square = u * u + v * v + w * w
            if square < PROXIMITY_RANGE_M * PROXIMITY_RANGE_M and now_s - point.seen_s <= KEPT_S:
                found.append((square, (u, v, w)))
        found.sort()
        return tuple(relative for _, relative in found[:MAX_NEAR_POINTS])

    def _add_point(self, here: Vector, axis: Vector, away_m: float, now_s: float) -> None:
        x, y, z = (p + away_m * a for p, a in zip(here, axis, strict=True))
        cube = (round(x / CUBE_M), round(y / CUBE_M), round(z / CUBE_M))
        if cube in self._points or len(self._points) < MAX_POINTS:
            self._points[cube] = MapPoint((x, y, z), now_s)

    def _forget_old(self, now_s: float) -> None:
        old = [cube for cube, point in self._points.items() if now_s - point.seen_s > KEPT_S]
        for cube in old:
            del self._points[cube]

    def _clear_passed(
        self, grid: Grid, ranges: Sequence[int], range_m: float, here: Vector, yaw: float
    ) -> None:
        """Forget points in front of an echo at once, and points on empty rays the second time."""
        x, y, z = here
        gone = []
        for cube, point in self._points.items():
            u, v, w = point.at[0] - x, point.at[1] - y, point.at[2] - z
            across = hypot(u, v)
            r = hypot(across, w)
            if not 0.0 < r < range_m - PASSED_M:
                continue
            azimuth = _wrapped(atan2(v, u) - yaw)
            ray = grid.ray_towards(azimuth, atan2(w, across))
            if ray is not None and _passed(point, ranges[ray], r):
                gone.append(cube)
        for cube in gone:
            del self._points[cube]


def _is_of_any(near: Sequence[Vector], axis: Vector, away_m: float, half: float) -> bool:
    """Whether an echo may be a neighbour's: a beam does not say from where in it an echo comes.

    near: the neighbours' positions, relative [m; world axes]. half: half the beam's angle [rad].
    """
    misses_m = [_miss_m(point, axis, away_m, half) for point in near]
    return min(misses_m, default=inf) < NEIGHBOUR_RADIUS_M


def _miss_m(point: Vector, axis: Vector, away_m: float, half: float) -> float:
    """Return how far a point is from where an echo may come from, in the beam and so far away [m].

    Exact where that is less than NEIGHBOUR_RADIUS_M, else too small.
    """
    u, v, w = point
    square = u * u + v * v + w * w
    point_m = sqrt(square)
    short_m = abs(point_m - away_m)
    if short_m >= NEIGHBOUR_RADIUS_M:
        return short_m
    ahead_m = u * axis[0] + v * axis[1] + w * axis[2]
    off_axis = atan2(sqrt(max(0.0, square - ahead_m * ahead_m)), ahead_m)
    off_beam = max(0.0, off_axis - half)
    return sqrt(short_m * short_m + 2.0 * point_m * away_m * (1.0 - cos(off_beam)))


def _passed(point: MapPoint, millimetres: int, away_m: float) -> bool:
    """Count what the ray towards a point measured; return whether the point is gone."""
    if millimetres == NO_ECHO_MM:
        point.misses += 1
    else:
        point.misses = MISSES if 0.001 * millimetres > away_m + PASSED_M else 0
    return point.misses >= MISSES


def _wrapped(angle: float) -> float:
    return angle - 2.0 * pi * round(angle / (2.0 * pi))
