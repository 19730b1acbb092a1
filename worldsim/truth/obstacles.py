"""Obstacles as arrays: their positions at a time, and distances of points from their surfaces.

Every shape is convex and keeps its heading, so the distance along a straight line has one minimum.
Only + - * / sqrt and comparisons act across rows here.
"""

from collections.abc import Sequence
from itertools import pairwise
from math import atan2, cos, dist, hypot, radians, sin
from typing import Final, Literal, NamedTuple, assert_never

import numpy as np
from numpy.typing import NDArray

from agent.messages import Vector
from worldsim.scenario.obstacle_tables import Box, Cylinder, Movable, Obstacle, Sphere, Wall
from worldsim.truth.vehicle import Floats

BISECTIONS: Final = 48
"""Halvings of a line of some centimetres; the result is finer than a float can tell."""

LEAST_LENGTH_M: Final = 1e-150
"""The square of a shorter vector is no longer exact."""


class SurfaceDistances(NamedTuple):
    """Distances of P points from the surfaces of M obstacles.

    The nearest point of a surface is the point less distance times outward.
    """

    distance: Floats
    """(P, M) [m]; negative inside."""
    outward: Floats
    """(P, M, 3), unit vectors along which the distance grows fastest [world axes]."""


class Relative(NamedTuple):
    """Where P points are relative to M obstacles at one time."""

    position: Floats
    """(P, M, 3) [m], relative to the centres."""
    surface: SurfaceDistances


class Solid(NamedTuple):
    """The shape of an obstacle about its centre."""

    kind: Literal["sphere", "cylinder", "box"]
    radius: float = 0.0
    """Of a sphere or a cylinder [m]."""
    half: Vector = (0.0, 0.0, 0.0)
    """Half of a box's size [m; its own axes]; of a cylinder only the half height."""
    yaw: float = 0.0
    """Heading of a box [rad; world frame]."""


class Path(NamedTuple):
    """The path of a moving obstacle."""

    points: Floats
    """Waypoints (K, 3) [m; world frame]."""
    along: Floats
    """Arc length at each waypoint (K,) [m]."""
    speed: float
    """[m/s]"""
    from_s: float
    """Time at which it starts to move [s]."""
    back: bool
    """Whether it turns back at the last waypoint; else it stops there."""

    def at(self, time_s: float) -> Floats:
        """Return the centre at a time, (3,) [m; world frame]."""
        whole = float(self.along[-1])
        s = self.speed * max(0.0, time_s - self.from_s)
        s = whole - abs(s % (2.0 * whole) - whole) if self.back else min(s, whole)
        leg = min(int(np.searchsorted(self.along, s, side="right")), len(self.along) - 1) - 1
        share = (s - self.along[leg]) / (self.along[leg + 1] - self.along[leg])
        here: Floats = self.points[leg] + share * (self.points[leg + 1] - self.points[leg])
        return here


class Obstacles:
    """All obstacles of a world; column j is the j-th obstacle of the scenario."""

    def __init__(self, tables: Sequence[Obstacle]) -> None:
        self.tables = tuple(tables)
        self._centre = np.array([_centre(each) for each in tables], dtype=np.float64)
        self._centre = self._centre.reshape(-1, 3)
        self._paths = {j: _path(each) for j, each in enumerate(tables) if _moves(each)}
        solids = [_solid(each) for each in tables]
        self.spheres = _columns(solids, "sphere")
        """Columns of the spheres."""
        self.cylinders = _columns(solids, "cylinder")
        """Columns of the cylinders."""
        self.boxes = _columns(solids, "box")
        """Columns of the boxes and walls."""
        self.radius = np.array([each.radius for each in solids])
        """(M,) [m]"""
        self.half = np.array([each.half for each in solids]).reshape(-1, 3)
        """(M, 3): half of each solid's size [m; its own axes]."""
        self.heading = np.array([(cos(each.yaw), sin(each.yaw)) for each in solids]).reshape(-1, 2)
        """(M, 2): cosine and sine of each solid's yaw."""

    def __len__(self) -> int:
        return len(self.tables)

    @property
    def moves(self) -> NDArray[np.bool_]:
        """Which obstacles move (M,)."""
        return np.array([column in self._paths for column in range(len(self))], dtype=np.bool_)

    def centres(self, time_s: float) -> Floats:
        """Return the centres at a time, (M, 3) [m; world frame]."""
        if not self._paths:
            return self._centre
        centre = self._centre.copy()
        for column, path in self._paths.items():
            centre[column] = path.at(time_s)
        return centre

    def nearest(self, points: Floats, time_s: float) -> SurfaceDistances:
        """Return the distances of points (P, 3) [m; world frame] from each surface at a time."""
        return self.relative(points, time_s).surface

    def relative(self, points: Floats, time_s: float) -> Relative:
        """Return where points (P, 3) [m; world frame] are relative to each obstacle at a time."""
        position = points[:, None] - self.centres(time_s)
        return Relative(position, self.from_centres(position))

    def from_centres(self, relative: Floats) -> SurfaceDistances:
        """Return the distances of points (P, M, 3) [m], given relative to the centres."""
        distance, outward = np.empty(relative.shape[:2]), np.empty(relative.shape)
        for columns, measure in (
            (self.spheres, self._from_spheres),
            (self.cylinders, self._from_cylinders),
            (self.boxes, self._from_boxes),
        ):
            if len(columns):
                found = measure(relative[:, columns], columns)
                distance[:, columns], outward[:, columns] = found
        return SurfaceDistances(distance, outward)

    def swept(self, start: Relative, end: Relative) -> Floats:
        """Return the least distances (P, M) [m] on the straight lines between relative points.

        NaN stays NaN.
        """
        (before, first), (after, last) = start, end
        way = after - before
        least = np.minimum(first.distance, last.distance)
        passing = (_dot(first.outward, way) < 0.0) & (_dot(last.outward, way) > 0.0)
        for row, column in np.argwhere(passing).tolist():
            here, way_here = before[row, column], way[row, column]
            least[row, column] = self._passing(column, here, way_here)
        return least

    def _passing(self, column: int, start: Floats, way: Floats) -> float:
        """Return the least distance [m] on a line that first approaches and then departs."""
        one = Obstacles(self.tables[column : column + 1])
        low, high = 0.0, 1.0
        for _ in range(BISECTIONS):
            middle = 0.5 * (low + high)
            found = one.from_centres((start + middle * way).reshape(1, 1, 3))
            if _dot(found.outward, way)[0, 0] < 0.0:
                low = middle
            else:
                high = middle
        return float(one.from_centres((start + high * way).reshape(1, 1, 3)).distance[0, 0])

    def _from_spheres(self, relative: Floats, columns: NDArray[np.intp]) -> SurfaceDistances:
        r = np.sqrt(_dot(relative, relative))
        return SurfaceDistances(r - self.radius[columns], _unit(relative, r))

    def _from_cylinders(self, relative: Floats, columns: NDArray[np.intp]) -> SurfaceDistances:
        x, y, z = np.moveaxis(relative, 2, 0)
        across = np.sqrt(x * x + y * y)
        side, cap = across - self.radius[columns], np.abs(z) - self.half[columns, 2]
        distance, (radial, upward) = _from_corner((side, cap))
        outward = radial / np.where(across > 0.0, across, 1.0)
        out_x = np.where(across > 0.0, x * outward, radial)
        out_z = np.copysign(upward, z)
        return SurfaceDistances(distance, np.stack((out_x, y * outward, out_z), axis=2))

    def _from_boxes(self, relative: Floats, columns: NDArray[np.intp]) -> SurfaceDistances:
        c, s = self.heading[columns].T
        half = self.half[columns]
        x, y, z = np.moveaxis(relative, 2, 0)
        ahead, left = c * x + s * y, c * y - s * x
        beyond = [np.abs(each) - half[:, k] for k, each in enumerate((ahead, left, z))]
        distance, away = _from_corner(tuple(beyond))
        a, b, up = (np.copysign(n, each) for n, each in zip(away, (ahead, left, z), strict=True))
        return SurfaceDistances(distance, np.stack((c * a - s * b, s * a + c * b, up), axis=2))


def _from_corner(beyond: tuple[Floats, ...]) -> tuple[Floats, list[Floats]]:
    """Return distances from a corner's body, and the components of the outward unit vectors.

    beyond: along each axis, how far the point lies past the face [m]; negative inside.
    """
    outer = [np.maximum(each, 0.0) for each in beyond]
    square = outer[0] * outer[0]
    for each in outer[1:]:
        square = square + each * each
    outside = np.sqrt(square)
    inside = beyond[0]
    for each in beyond[1:]:
        inside = np.maximum(inside, each)
    out, taken = outside > 0.0, np.zeros(inside.shape, dtype=np.bool_)
    outward = []
    for past, each in zip(outer, beyond, strict=True):
        face = (each == inside) & ~taken
        taken |= face
        outward.append(np.where(out, past / np.where(out, outside, 1.0), face))
    return np.where(out, outside, inside), outward


def _unit(vector: Floats, length: Floats) -> Floats:
    """Return unit vectors; straight up for those of no length that can be told."""
    sound = (length > LEAST_LENGTH_M)[:, :, None]
    scaled: Floats = vector / np.where(sound, length[:, :, None], 1.0)
    return np.where(sound | np.isnan(vector), scaled, (0.0, 0.0, 1.0))


def _dot(a: Floats, b: Floats) -> Floats:
    product = a * b
    total: Floats = product[..., 0] + product[..., 1] + product[..., 2]
    return total


def _columns(solids: Sequence[Solid], kind: str) -> NDArray[np.intp]:
    return np.array([j for j, each in enumerate(solids) if each.kind == kind], dtype=np.intp)


def _moves(obstacle: Obstacle) -> bool:
    return isinstance(obstacle, Movable) and obstacle.waypoints_m is not None


def _path(obstacle: Obstacle) -> Path:
    assert isinstance(obstacle, Movable) and obstacle.waypoints_m and obstacle.speed_mps
    # A repeated waypoint would make a leg of no length, so repetitions are left out.
    points = [obstacle.waypoints_m[0]]
    points += [there for here, there in pairwise(obstacle.waypoints_m) if here != there]
    along = [0.0]
    for here, there in pairwise(points):
        along.append(along[-1] + dist(here, there))
    back = obstacle.at_end == "back"
    return Path(np.array(points), np.array(along), obstacle.speed_mps, obstacle.from_s, back)


def _centre(obstacle: Obstacle) -> Vector:
    """Return the centre of an obstacle before it moves [m; world frame]."""
    if isinstance(obstacle, Wall):
        (x, y, z), (to_x, to_y, _) = obstacle.from_m, obstacle.to_m
        return (0.5 * (x + to_x), 0.5 * (y + to_y), z + 0.5 * obstacle.height_m)
    if obstacle.waypoints_m is not None:
        return obstacle.waypoints_m[0]
    assert obstacle.centre_m is not None
    return obstacle.centre_m


def _solid(obstacle: Obstacle) -> Solid:
    match obstacle:
        case Sphere():
            return Solid("sphere", obstacle.radius_m)
        case Cylinder():
            return Solid("cylinder", obstacle.radius_m, (0.0, 0.0, 0.5 * obstacle.height_m))
        case Box():
            x, y, z = obstacle.size_m
            half = (0.5 * x, 0.5 * y, 0.5 * z)
            return Solid("box", half=half, yaw=radians(obstacle.yaw_deg))
        case Wall():
            return _wall(obstacle)
    assert_never(obstacle)


def _wall(wall: Wall) -> Solid:
    dx, dy = wall.to_m[0] - wall.from_m[0], wall.to_m[1] - wall.from_m[1]
    half = (0.5 * hypot(dx, dy), 0.5 * wall.thickness_m, 0.5 * wall.height_m)
    return Solid("box", half=half, yaw=atan2(dy, dx))
