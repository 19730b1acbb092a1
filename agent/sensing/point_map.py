"""The map of points seen of late: what a narrow sensor saw stays known when it looks elsewhere.

A field of cubes, each with its last point; what was not seen again for some seconds is forgotten,
and so is what a later ray passes through: vehicles move on, and leave no wall behind.
"""

from array import array
from collections.abc import Iterable, Sequence
from math import atan2, cos, hypot, pi, sin

from agent.messages import NO_ECHO_MM, PROXIMITY_RANGE_M, Scan, Vector
from agent.sensing.ray_pattern import Grid, Pattern

KEPT_S = 6.0
VOXEL_M = 0.15
MOST_NEAR = 24
MAX_POINTS = 2000
PASSED_M = 0.3
"""An echo from so much farther shows that a point before it is gone."""
MISSES = 2
"""So many rays that meet nothing show it too: one may have been a dropout."""
OWN_BODY_M = 0.3
"""A point so near to where a neighbour says it is, is that neighbour."""

Cube = tuple[int, int, int]


class Point:
    """A point seen [m; world frame], when last [s], and how many rays met nothing there since."""

    __slots__ = ("at", "misses", "seen_s")

    def __init__(self, at: Vector, seen_s: float) -> None:
        self.at = at
        self.seen_s = seen_s
        self.misses = 0


class PointMap:
    """What one agent's scanning sensors saw, as points in the world frame."""

    def __init__(self, patterns: Sequence[Pattern]) -> None:
        self._patterns = {pattern.kind: pattern for pattern in patterns}
        self._points: dict[Cube, Point] = {}

    def __len__(self) -> int:
        return len(self._points)

    def take(
        self, scan: Scan, here: Vector, yaw: float, now_s: float, others: Sequence[Vector] = ()
    ) -> None:
        """Take a scan made at a pose [m, rad; world frame]; others: where neighbours are [m].

        A scan of a sensor one does not have, or of another length, says nothing.
        """
        pattern = self._patterns.get(scan.kind)
        ranges = array("H", scan.ranges) if len(scan.ranges) % 2 == 0 else array("H")
        if pattern is None or len(ranges) != len(pattern.axes):
            return
        self._forget(now_s)
        axes = _turned(pattern.axes, yaw)
        if pattern.grid is not None:
            self._pass_through(pattern.grid, ranges, pattern.range_m, here, yaw)
        for axis, millimetres in zip(axes, ranges, strict=True):
            if millimetres != NO_ECHO_MM:
                self._mark(axis, 0.001 * millimetres, here, now_s, others)

    def near(self, here: Vector, now_s: float) -> tuple[Vector, ...]:
        """Return the points within 2 m of a place, relative to it [m; world axes], nearest first.

        Of a surface that is seen as many points, only the 24 nearest.
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
        return tuple(relative for _, relative in found[:MOST_NEAR])

    def _mark(
        self, axis: Vector, away_m: float, here: Vector, now_s: float, others: Iterable[Vector]
    ) -> None:
        x, y, z = (p + away_m * a for p, a in zip(here, axis, strict=True))
        for u, v, w in others:
            if (x - u) ** 2 + (y - v) ** 2 + (z - w) ** 2 < OWN_BODY_M * OWN_BODY_M:
                return
        cube = (round(x / VOXEL_M), round(y / VOXEL_M), round(z / VOXEL_M))
        if cube in self._points or len(self._points) < MAX_POINTS:
            self._points[cube] = Point((x, y, z), now_s)

    def _forget(self, now_s: float) -> None:
        old = [cube for cube, point in self._points.items() if now_s - point.seen_s > KEPT_S]
        for cube in old:
            del self._points[cube]

    def _pass_through(
        self, grid: Grid, ranges: Sequence[int], range_m: float, here: Vector, yaw: float
    ) -> None:
        """Forget points before what a ray met; those before nothing, at the second time."""
        x, y, z = here
        gone = []
        for cube, point in self._points.items():
            u, v, w = point.at[0] - x, point.at[1] - y, point.at[2] - z
            across = hypot(u, v)
            r = hypot(across, w)
            if not 0.0 < r < range_m - PASSED_M:
                continue
            azimuth = _wrapped(atan2(v, u) - yaw)
            ray = grid.towards(azimuth, atan2(w, across))
            if ray is not None and _passed(point, ranges[ray], r):
                gone.append(cube)
        for cube in gone:
            del self._points[cube]


def _passed(point: Point, millimetres: int, away_m: float) -> bool:
    """Note what a ray met that looks at a point; return whether the point is gone."""
    if millimetres == NO_ECHO_MM:
        point.misses += 1
    else:
        point.misses = MISSES if 0.001 * millimetres > away_m + PASSED_M else 0
    return point.misses >= MISSES


def _turned(axes: Iterable[Vector], yaw: float) -> list[Vector]:
    c, s = cos(yaw), sin(yaw)
    return [(c * x - s * y, s * x + c * y, z) for x, y, z in axes]


def _wrapped(angle: float) -> float:
    return angle - 2.0 * pi * round(angle / (2.0 * pi))
