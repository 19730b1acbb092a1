"""Obstacles of a scenario: listed one by one, or drawn in a box from the scenario's seed.

A sphere, box or cylinder rests at ``centre_m``, or its centre moves along ``waypoints_m``. A drawn
field becomes part of the list, so that a resolved scenario holds every obstacle that was flown.
"""

from collections.abc import Iterator, Sequence
from itertools import pairwise
from math import ceil, dist, hypot
from typing import Annotated, Literal, NamedTuple, assert_never

import numpy as np
from msgspec import Meta

from agent.config import LEAST, Positive, Table
from agent.messages import MAX_M, Position, Vector
from worldsim.scenario.problem import Problem
from worldsim.scenario.start import BoxStart, Degrees, Extent, ListStart

MAX_OBSTACLES = 1000
MAX_HEIGHT_M = 1e4
MAX_TRIES = 2000
"""Draws for a field, besides TRIES_EACH for each obstacle, after which its box counts as full."""
TRIES_EACH = 20
FIELD_KEY = 0xF1E1D
"""Separates the draws of a field from other draws with the same seed."""

Waypoints = Annotated[tuple[Position, ...], Meta(min_length=2, max_length=64)]
Range = tuple[Positive, Positive]
"""The least value, then the largest."""


class Movable(Table, frozen=True):
    """An obstacle that rests at ``centre_m``, or moves along ``waypoints_m`` from ``from_s`` on.

    at_end: at the last waypoint it turns "back" and goes to and fro, or it stops ("stop").
    """

    centre_m: Position | None = None  # world frame
    waypoints_m: Waypoints | None = None  # world frame
    speed_mps: Annotated[float, Meta(ge=LEAST, le=50)] | None = None
    at_end: Literal["back", "stop"] = "back"
    from_s: Annotated[float, Meta(ge=0, le=86_400)] = 0.0


class Sphere(Movable, frozen=True, tag="sphere", tag_field="shape", kw_only=True):
    """A sphere."""

    radius_m: Positive


class Box(Movable, frozen=True, tag="box", tag_field="shape", kw_only=True):
    """A box of a length, width and height, turned about the vertical."""

    size_m: tuple[Positive, Positive, Positive]
    yaw_deg: Degrees = 0.0  # from +x towards +y


class Cylinder(Movable, frozen=True, tag="cylinder", tag_field="shape", kw_only=True):
    """An upright cylinder; its centre is at half its height."""

    radius_m: Positive
    height_m: Positive


class Wall(Table, frozen=True, tag="wall", tag_field="shape"):
    """An upright wall; ``from_m`` and ``to_m`` are the ends of the centre line of its foot."""

    from_m: Position  # world frame
    to_m: Position  # world frame
    height_m: Positive
    thickness_m: Positive = 0.1


Obstacle = Sphere | Box | Cylinder | Wall
Obstacles = Annotated[tuple[Obstacle, ...], Meta(max_length=MAX_OBSTACLES)]


class ObstacleField(Table, frozen=True):
    """Random obstacles in a box, drawn from the seed: ``count``, or a number per cubic metre.

    shape: spheres inside the box, or cylinders of its height. radius_m: the least and the largest.
    corridor_m: the least distance between two surfaces. clear_of_start_m: the least distance from a
    surface to the vehicles' start.
    """

    centre_m: Position  # world frame
    size_m: tuple[Extent, Extent, Extent]  # along x, y, z
    count: Annotated[int, Meta(ge=1, le=MAX_OBSTACLES)] | None = None
    density_per_m3: Annotated[float, Meta(gt=0, le=1e4)] | None = None
    shape: Literal["sphere", "cylinder"] = "sphere"
    radius_m: Range = (0.3, 0.6)
    corridor_m: Extent = 1.7
    clear_of_start_m: Extent = 1.0

    @property
    def total(self) -> int:
        """The number of obstacles that the field asks for."""
        if self.count is not None:
            return self.count
        length, width, height = self.size_m
        return ceil((self.density_per_m3 or 0.0) * length * width * height - 1e-9)


class _Placement(NamedTuple):
    """A drawn obstacle: its centre [m; world frame] and radius [m]."""

    centre: Vector
    radius: float


def resolve_field(
    field: ObstacleField, start: BoxStart | ListStart, seed: int
) -> tuple[tuple[Obstacle, ...], Problem | None]:
    """Return a field's obstacles, and what is wrong with the field if anything is."""
    problem = field_problem(field)
    if problem is not None:
        return (), problem
    found = tuple(draw_obstacles(field, start, seed))
    return found, _room_problem(field, len(found)) if len(found) < field.total else None


def draw_obstacles(
    field: ObstacleField, start: BoxStart | ListStart, seed: int
) -> Iterator[Obstacle]:
    """Yield a field's obstacles; fewer than it asks for where the box has no room for more."""
    generator = np.random.Generator(np.random.Philox(key=[seed, FIELD_KEY]))
    placed: list[_Placement] = []
    for _ in range(MAX_TRIES + TRIES_EACH * field.total):
        if len(placed) == field.total:
            return
        found = _draw(field, generator)
        if _has_room(field, start, placed, found):
            placed.append(found)
            yield _shaped(field, found)


def field_problem(field: ObstacleField) -> Problem | None:
    """Return what is wrong with a field before anything is drawn."""
    if (field.count is None) == (field.density_per_m3 is None):
        return Problem("count", "give count or density_per_m3; one of the two")
    if field.total > MAX_OBSTACLES:
        return Problem("density_per_m3", f"{field.total} obstacles; at most {MAX_OBSTACLES}")
    if field.shape == "cylinder" and not LEAST <= field.size_m[2] <= MAX_HEIGHT_M:
        detail = "it is the height of the field's cylinders"
        return Problem("size_m[2]", f"must be above 0, {LEAST:g} to {MAX_HEIGHT_M:g}: {detail}")
    for axis, (centre, size) in enumerate(zip(field.centre_m, field.size_m, strict=True)):
        if abs(centre) + 0.5 * size > MAX_M:
            return Problem(f"centre_m[{axis}]", f"the field reaches beyond {MAX_M:g} m")
    least, largest = field.radius_m
    if least > largest:
        detail = f"[{least:g}, {largest:g}]; the least first, then the largest"
        return Problem("radius_m", detail)
    return None


def obstacle_problem(obstacle: Obstacle) -> Problem | None:
    """Return what is wrong with an obstacle's table."""
    match obstacle:
        case Wall():
            return _wall_problem(obstacle)
        case Sphere() | Box() | Cylinder():
            return _movable_problem(obstacle)
        case _:
            assert_never(obstacle)


def _movable_problem(obstacle: Movable) -> Problem | None:
    if (obstacle.centre_m is None) == (obstacle.waypoints_m is None):
        detail = "centre_m to rest there, or waypoints_m to move along them; one of the two"
        return Problem("centre_m", detail)
    if (obstacle.waypoints_m is None) != (obstacle.speed_mps is None):
        return Problem("speed_mps", "goes with waypoints_m; both or neither")
    if obstacle.waypoints_m is not None and _path_length_m(obstacle.waypoints_m) == 0.0:
        return Problem("waypoints_m", "all at one place; use centre_m for an obstacle at rest")
    return None


def _wall_problem(wall: Wall) -> Problem | None:
    if wall.from_m[2] != wall.to_m[2]:
        detail = f"height {wall.to_m[2]:g}; it must equal that of from_m, {wall.from_m[2]:g}"
        return Problem("to_m", detail)
    if wall.from_m == wall.to_m:
        return Problem("to_m", "equals from_m; a wall has a length above 0")
    return None


def _room_problem(field: ObstacleField, found: int) -> Problem:
    size = " x ".join(f"{edge:g}" for edge in field.size_m)
    return Problem(
        "count" if field.count is not None else "density_per_m3",
        f"room for {found} of {field.total} obstacles {field.corridor_m:g} m apart in a box of"
        f" {size} m, {field.clear_of_start_m:g} m from the start; use fewer, or a smaller"
        " corridor_m",
    )


def _path_length_m(waypoints: Sequence[Vector]) -> float:
    return sum(dist(here, there) for here, there in pairwise(waypoints))


def _draw(field: ObstacleField, generator: np.random.Generator) -> _Placement:
    """Draw an obstacle in a field, whether or not there is room around it."""
    least, largest = field.radius_m
    *share, radius_share = generator.random(4).tolist()
    centre = _centre_at(field, (share[0], share[1], share[2]))
    return _Placement(centre, radius=least + (largest - least) * radius_share)


def _centre_at(field: ObstacleField, share: Vector) -> Vector:
    """Return the centre at shares, 0 to 1, of the box's edges; cylinders are as high as the box."""
    (x, y, z), (length_m, width_m, height_m) = field.centre_m, field.size_m
    ahead, left, up = (each - 0.5 for each in share)
    match field.shape:
        case "sphere":
            return (x + length_m * ahead, y + width_m * left, z + height_m * up)
        case "cylinder":
            return (x + length_m * ahead, y + width_m * left, z)
        case _:
            assert_never(field.shape)


def _has_room(
    field: ObstacleField,
    start: BoxStart | ListStart,
    placed: Sequence[_Placement],
    placement: _Placement,
) -> bool:
    centre, radius = placement
    gaps_m = (dist(centre, other.centre) - radius - other.radius for other in placed)
    if not all(gap_m >= field.corridor_m for gap_m in gaps_m):
        return False
    return _distance_from_start(field, start, centre) - radius >= field.clear_of_start_m


def _distance_from_start(
    field: ObstacleField, start: BoxStart | ListStart, centre: Vector
) -> float:
    """Return the distance from an obstacle's centre or axis to the vehicles' start [m]."""
    match start:
        case ListStart():
            return min(_distance(field, centre, position) for position in start.positions_m)
        case BoxStart():
            x, y, z = (
                min(max(c, middle - 0.5 * size), middle + 0.5 * size)
                for c, middle, size in zip(centre, start.centre_m, start.size_m, strict=True)
            )
            return _distance(field, centre, (x, y, z))
        case _:
            assert_never(start)


def _distance(field: ObstacleField, centre: Vector, point: Vector) -> float:
    """Return the distance from a point to an obstacle's centre, or to a cylinder's axis [m]."""
    match field.shape:
        case "sphere":
            return dist(centre, point)
        case "cylinder":
            return hypot(centre[0] - point[0], centre[1] - point[1])
        case _:
            assert_never(field.shape)


def _shaped(field: ObstacleField, placement: _Placement) -> Obstacle:
    match field.shape:
        case "sphere":
            return Sphere(centre_m=placement.centre, radius_m=placement.radius)
        case "cylinder":
            return Cylinder(
                centre_m=placement.centre, radius_m=placement.radius, height_m=field.size_m[2]
            )
        case _:
            assert_never(field.shape)
