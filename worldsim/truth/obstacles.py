"""Obstacles as arrays: where they are at a time, and how far from points.

Every shape is convex and keeps its heading, so the distance along a straight way has one minimum.
Only + - * / sqrt and comparisons cross rows here.
"""

from collections.abc import Sequence
from itertools import pairwise
from math import atan2, cos, dist, hypot, radians, sin
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from agent.messages import Vector
from worldsim.scenario.obstacle_tables import Box, Cylinder, Movable, Obstacle, Sphere, Wall
from worldsim.truth.vehicle import Floats

BISECTIONS = 48
"""A way of some centimetres is cut in two so often: far below what a float can tell."""


class Nearest(NamedTuple):
    """For each point and obstacle: distance to the surface (P, M) [m], negative within.

    away (P, M, 3): the unit vector along which the distance grows fastest [world axes]. The
    nearest point of a surface is the point less distance times away.
    """

    distance: Floats
    away: Floats


class Path(NamedTuple):
    """A moving obstacle's way: waypoints (K, 3) [m], arc lengths there (K,) [m], and its pace."""

    points: Floats
    along: Floats
    speed: float
    from_s: float
    back: bool

    def at(self, time_s: float) -> Floats:
        """Return where the centre is at a time [m; world frame]."""
        whole = float(self.along[-1])
        s = self.speed * max(0.0, time_s - self.from_s)
        s = whole - abs(s % (2.0 * whole) - whole) if self.back else min(s, whole)
        leg = min(int(np.searchsorted(self.along, s, side="right")), len(self.along) - 1) - 1
        share = (s - self.along[leg]) / (self.along[leg + 1] - self.along[leg])
        here: Floats = self.points[leg] + share * (self.points[leg + 1] - self.points[leg])
        return here


class Obstacles:
    """All obstacles of a world; column j is the j-th of the scenario.

    spheres, cylinders, boxes: columns of each kind, walls being boxes. radius (M,) [m]; half
    (M, 3): half of a box's size, and of a cylinder's height [m]; heading (M, 2): cosine and sine of
    a box's.
    """

    def __init__(self, tables: Sequence[Obstacle]) -> None:
        self.tables = tuple(tables)
        self._centre = np.array([_centre(each) for each in tables], dtype=np.float64)
        self._centre = self._centre.reshape(-1, 3)
        self._paths = {j: _path(each) for j, each in enumerate(tables) if _moves(each)}
        self.spheres = _columns(tables, Sphere)
        self.cylinders = _columns(tables, Cylinder)
        self.boxes = np.sort(np.concatenate((_columns(tables, Box), _columns(tables, Wall))))
        self.radius = np.array([getattr(each, "radius_m", 0.0) for each in tables])
        self.half = np.array([_half(each) for each in tables]).reshape(-1, 3)
        self.heading = np.array([_heading(each) for each in tables]).reshape(-1, 2)

    def __len__(self) -> int:
        return len(self.tables)

    @property
    def moves(self) -> NDArray[np.bool_]:
        """Which of them move (M,)."""
        return np.array([column in self._paths for column in range(len(self))], dtype=np.bool_)

    def centres(self, time_s: float) -> Floats:
        """Return where the centres are at a time, (M, 3) [m; world frame]."""
        if not self._paths:
            return self._centre
        centre = self._centre.copy()
        for column, path in self._paths.items():
            centre[column] = path.at(time_s)
        return centre

    def nearest(self, points: Floats, time_s: float) -> Nearest:
        """Return how far points (P, 3) [m; world frame] are from each surface at a time."""
        relative = points[:, None] - self.centres(time_s)
        return self.from_centres(relative)

    def from_centres(self, relative: Floats) -> Nearest:
        """Return how far points are from each surface; (P, M, 3) [m], relative to the centres."""
        distance, away = np.empty(relative.shape[:2]), np.empty(relative.shape)
        for columns, form in (
            (self.spheres, self._from_spheres),
            (self.cylinders, self._from_cylinders),
            (self.boxes, self._from_boxes),
        ):
            if len(columns):
                found = form(relative[:, columns], columns)
                distance[:, columns], away[:, columns] = found
        return Nearest(distance, away)

    def swept(self, before: Floats, after: Floats) -> Floats:
        """Return the least distance (P, M) on the straight way between relative points [m].

        before, after: (P, M, 3), relative to where the centres were and are. NaN stays NaN.
        """
        first, last = self.from_centres(before), self.from_centres(after)
        way = after - before
        least = np.minimum(first.distance, last.distance)
        passing = (_dot(first.away, way) < 0.0) & (_dot(last.away, way) > 0.0)
        for row, column in np.argwhere(passing).tolist():
            here, way_here = before[row, column], way[row, column]
            least[row, column] = self._passing(column, here, way_here)
        return least

    def _passing(self, column: int, start: Floats, way: Floats) -> float:
        """Return the least distance on a way that comes nearer first and then goes [m]."""
        one = Obstacles(self.tables[column : column + 1])
        low, high = 0.0, 1.0
        for _ in range(BISECTIONS):
            middle = 0.5 * (low + high)
            found = one.from_centres((start + middle * way).reshape(1, 1, 3))
            if _dot(found.away, way)[0, 0] < 0.0:
                low = middle
            else:
                high = middle
        return float(one.from_centres((start + high * way).reshape(1, 1, 3)).distance[0, 0])

    def _from_spheres(self, relative: Floats, columns: NDArray[np.intp]) -> Nearest:
        r = np.sqrt(_dot(relative, relative))
        return Nearest(r - self.radius[columns], _unit(relative, r))

    def _from_cylinders(self, relative: Floats, columns: NDArray[np.intp]) -> Nearest:
        x, y, z = np.moveaxis(relative, 2, 0)
        across = np.sqrt(x * x + y * y)
        side, cap = across - self.radius[columns], np.abs(z) - self.half[columns, 2]
        distance, (radial, upward) = _from_corner((side, cap))
        outward = radial / np.where(across > 0.0, across, 1.0)
        out_x = np.where(across > 0.0, x * outward, radial)
        return Nearest(distance, np.stack((out_x, y * outward, np.copysign(upward, z)), axis=2))

    def _from_boxes(self, relative: Floats, columns: NDArray[np.intp]) -> Nearest:
        c, s = self.heading[columns].T
        half = self.half[columns]
        x, y, z = np.moveaxis(relative, 2, 0)
        ahead, left = c * x + s * y, c * y - s * x
        beyond = [np.abs(each) - half[:, k] for k, each in enumerate((ahead, left, z))]
        distance, away = _from_corner(tuple(beyond))
        a, b, up = (np.copysign(n, each) for n, each in zip(away, (ahead, left, z), strict=True))
        return Nearest(distance, np.stack((c * a - s * b, s * a + c * b, up), axis=2))


def _from_corner(beyond: tuple[Floats, ...]) -> tuple[Floats, list[Floats]]:
    """Return the distance from a corner's body, and the parts of the unit vector away from it.

    beyond: along each axis, how far past the face [m], negative within.
    """
    outer = [np.maximum(each, 0.0) for each in beyond]
    square = outer[0] * outer[0]
    for each in outer[1:]:
        square = square + each * each
    launcher = np.sqrt(square)
    inside = beyond[0]
    for each in beyond[1:]:
        inside = np.maximum(inside, each)
    out, taken = launcher > 0.0, np.zeros(inside.shape, dtype=np.bool_)
    away = []
    for past, each in zip(outer, beyond, strict=True):
        face = (each == inside) & ~taken
        taken |= face
        away.append(np.where(out, past / np.where(out, launcher, 1.0), face))
    return np.where(out, launcher, inside), away


def _unit(vector: Floats, length: Floats) -> Floats:
    """Return unit vectors; straight up for those of no length."""
    sound = (length > 0.0)[:, :, None]
    scaled: Floats = vector / np.where(sound, length[:, :, None], 1.0)
    return np.where(sound | np.isnan(vector), scaled, (0.0, 0.0, 1.0))


def _dot(a: Floats, b: Floats) -> Floats:
    product = a * b
    total: Floats = product[..., 0] + product[..., 1] + product[..., 2]
    return total


def _columns(tables: Sequence[Obstacle], kind: type[Obstacle]) -> NDArray[np.intp]:
    return np.array([j for j, each in enumerate(tables) if isinstance(each, kind)], dtype=np.intp)


def _moves(obstacle: Obstacle) -> bool:
    return isinstance(obstacle, Movable) and obstacle.waypoints_m is not None


def _path(obstacle: Obstacle) -> Path:
    assert isinstance(obstacle, Movable) and obstacle.waypoints_m and obstacle.speed_mps
    # A waypoint twice has no way between: one of the two is left out.
    points = [obstacle.waypoints_m[0]]
    points += [there for here, there in pairwise(obstacle.waypoints_m) if here != there]
    along = [0.0]
    for here, there in pairwise(points):
        along.append(along[-1] + dist(here, there))
    back = obstacle.at_end == "back"
    return Path(np.array(points), np.array(along), obstacle.speed_mps, obstacle.from_s, back)


def _centre(obstacle: Obstacle) -> Vector:
    if isinstance(obstacle, Wall):
        (x, y, z), (to_x, to_y, _) = obstacle.from_m, obstacle.to_m
        return (0.5 * (x + to_x), 0.5 * (y + to_y), z + 0.5 * obstacle.height_m)
    if obstacle.waypoints_m is not None:
        return obstacle.waypoints_m[0]
    assert obstacle.centre_m is not None
    return obstacle.centre_m


def _half(obstacle: Obstacle) -> Vector:
    match obstacle:
        case Box(size_m=(x, y, z)):
            return (0.5 * x, 0.5 * y, 0.5 * z)
        case Wall(from_m=a, to_m=b):
            along = hypot(b[0] - a[0], b[1] - a[1])
            return (0.5 * along, 0.5 * obstacle.thickness_m, 0.5 * obstacle.height_m)
        case Cylinder(height_m=height):
            return (0.0, 0.0, 0.5 * height)
    return (0.0, 0.0, 0.0)


def _heading(obstacle: Obstacle) -> tuple[float, float]:
    """Return cosine and sine of a box's or a wall's heading."""
    angle = 0.0
    if isinstance(obstacle, Wall):
        angle = atan2(obstacle.to_m[1] - obstacle.from_m[1], obstacle.to_m[0] - obstacle.from_m[0])
    elif isinstance(obstacle, Box):
        angle = radians(obstacle.yaw_deg)
    return cos(angle), sin(angle)
