"""Obstacles: their positions at a time, and distances of points from their surfaces.

Every shape is convex and keeps its heading, so the distance along a straight line has one minimum.
"""

from collections.abc import Sequence
from itertools import pairwise
from math import atan2, copysign, cos, dist, hypot, inf, isnan, nan, radians, sin, sqrt
from typing import Final, Literal, NamedTuple, assert_never, final

import numpy as np
from numpy.typing import NDArray

from agent.messages import Vector
from worldsim.scenario.obstacle_tables import Box, Cylinder, Movable, Obstacle, Sphere, Wall
from worldsim.truth.vehicle import Floats, array_of

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


Surface = tuple[float, Vector]
"""The distance of a point from a surface [m], negative inside, and the unit vector along which it
grows fastest [world axes]."""


NOWHERE: Final[Surface] = (nan, (nan, nan, nan))


@final
class Solid:
    """The shape of an obstacle about its centre.

    radius: of a sphere or a cylinder [m]. half: half of a box's size [m; its own axes]; of a
    cylinder only the half height. yaw: heading of a box [rad; world frame].
    """

    def __init__(
        self,
        kind: Literal["sphere", "cylinder", "box"],
        radius: float = 0.0,
        half: Vector = (0.0, 0.0, 0.0),
        yaw: float = 0.0,
    ) -> None:
        self.kind = kind
        self.radius = radius
        self.half = half
        self.yaw = yaw
        self._cos, self._sin = cos(yaw), sin(yaw)

    def surface_from(self, x: float, y: float, z: float) -> Surface:
        """Return the surface as seen from a point relative to the centre [m; world axes]."""
        if self.kind == "sphere":
            length = sqrt(x * x + y * y + z * z)
            return length - self.radius, _unit(x, y, z, length)
        if self.kind == "cylinder":
            return self._from_cylinder(x, y, z)
        return self._from_box(x, y, z)

    def _from_cylinder(self, x: float, y: float, z: float) -> Surface:
        across = sqrt(x * x + y * y)
        distance, (radial, upward, _) = _from_corner(
            across - self.radius, abs(z) - self.half[2], -inf
        )
        up = copysign(upward, z)
        if not across > 0.0:
            return distance, (radial, y * radial, up)
        outward = radial / across
        return distance, (x * outward, y * outward, up)

    def _from_box(self, x: float, y: float, z: float) -> Surface:
        c, s = self._cos, self._sin
        ahead, left = c * x + s * y, c * y - s * x
        half_x, half_y, half_z = self.half
        distance, (a, b, up) = _from_corner(
            abs(ahead) - half_x, abs(left) - half_y, abs(z) - half_z
        )
        a, b = copysign(a, ahead), copysign(b, left)
        return distance, (c * a - s * b, s * a + c * b, copysign(up, z))


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
        self._solids = solids = [_solid(each) for each in tables]
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
        self._centred: list[Vector] = []
        """The centres at ``_centred_s``, at any time where no obstacle moves."""
        self._centred_s = nan

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

    def near(self, point: Vector, time_s: float, within_m: float) -> list[tuple[int, Surface]]:
        """Return the surfaces within a distance [m] of a point, and the columns of their obstacles.

        point [m; world frame]; time_s: the simulated time [s].
        """
        x, y, z = point
        found = []
        for column, (a, b, c) in enumerate(self._centres_at(time_s)):
            surface = self._solids[column].surface_from(x - a, y - b, z - c)
            if surface[0] <= within_m:
                found.append((column, surface))
        return found

    def _centres_at(self, time_s: float) -> list[Vector]:
        if not self._centred or (self._paths and time_s != self._centred_s):
            self._centred = [(x, y, z) for x, y, z in self.centres(time_s).tolist()]
            self._centred_s = time_s
        return self._centred

    def nearest(self, points: Floats, time_s: float) -> SurfaceDistances:
        """Return the distances of points (P, 3) [m; world frame] from each surface at a time."""
        return self.relative(points, time_s).surface

    def relative(self, points: Floats, time_s: float) -> Relative:
        """Return where points (P, 3) [m; world frame] are relative to each obstacle at a time."""
        position = points[:, None] - self.centres(time_s)
        return Relative(position, self.from_centres(position))

    def from_centres(self, relative: Floats) -> SurfaceDistances:
        """Return the distances of points (P, M, 3) [m], given relative to the centres.

        NaN stays NaN.
        """
        distances: list[float] = []
        outward: list[float] = []
        rows: list[list[list[float]]] = relative.tolist()
        for row in rows:
            for column, (x, y, z) in enumerate(row):
                distance, (a, b, c) = NOWHERE
                if not isnan(x):
                    distance, (a, b, c) = self._solids[column].surface_from(x, y, z)
                distances.append(distance)
                outward.append(a)
                outward.append(b)
                outward.append(c)
        shape = relative.shape
        return SurfaceDistances(
            array_of(distances).reshape(shape[:2]), array_of(outward).reshape(shape)
        )

    def swept(self, start: Relative, end: Relative) -> Floats:
        """Return the least distances (P, M) [m] on the straight lines between relative points.

        NaN stays NaN.
        """
        (before, first), (after, last) = start, end
        way = after - before
        least = np.minimum(first.distance, last.distance)
        passing = (_dot(first.outward, way) < 0.0) & (_dot(last.outward, way) > 0.0)
        for row, column in np.argwhere(passing).tolist():
            (x, y, z), (u, v, w) = before[row, column].tolist(), way[row, column].tolist()
            least[row, column] = self._passing(column, (x, y, z), (u, v, w))
        return least

    def _passing(self, column: int, start: Vector, way: Vector) -> float:
        """Return the least distance [m] on a line that first approaches and then departs."""
        solid = self._solids[column]
        x, y, z = start
        u, v, w = way
        low, high = 0.0, 1.0
        for _ in range(BISECTIONS):
            middle = 0.5 * (low + high)
            _, (a, b, c) = solid.surface_from(x + middle * u, y + middle * v, z + middle * w)
            if a * u + b * v + c * w < 0.0:
                low = middle
            else:
                high = middle
        return solid.surface_from(x + high * u, y + high * v, z + high * w)[0]


def _unit(x: float, y: float, z: float, length: float) -> Vector:
    """Return a unit vector; straight up for one of no length that can be told."""
    if length > LEAST_LENGTH_M:
        return x / length, y / length, z / length
    return 0.0, 0.0, 1.0


def _from_corner(a: float, b: float, c: float) -> Surface:
    """Return the distance from a corner's body, and the components of the outward unit vector.

    a, b, c: along each axis, how far the point lies past the face [m]; negative inside.
    """
    past_a, past_b, past_c = max(a, 0.0), max(b, 0.0), max(c, 0.0)
    outside = sqrt(past_a * past_a + past_b * past_b + past_c * past_c)
    if outside > 0.0:
        return outside, (past_a / outside, past_b / outside, past_c / outside)
    inside = max(a, b, c)
    if a == inside:
        return inside, (1.0, 0.0, 0.0)
    return inside, (0.0, 1.0, 0.0) if b == inside else (0.0, 0.0, 1.0)


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
