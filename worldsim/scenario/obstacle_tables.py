"""Obstacles of a scenario: given one by one, or drawn in a box by the scenario's seed.

A sphere, box or cylinder stands at ``centre_m``, or moves along ``waypoints_m``, its centre on
their line. A drawn field is resolved into the list: a resolved scenario holds every obstacle that
was flown.
"""

from collections.abc import Iterator, Sequence
from itertools import pairwise
from math import ceil, dist, hypot
from typing import Annotated, Literal

import numpy as np
from msgspec import Meta

from agent.config import Positive, Table
from agent.messages import Vector
from worldsim.scenario.start import BoxStart, Degrees, Extent, ListStart, Triple

MAX_OBSTACLES = 1000
TRIES = 2000
"""For one obstacle of a field; a box that refuses so many draws has no room."""
FIELD_KEY = 0xF1E1D

Waypoints = Annotated[tuple[Triple, ...], Meta(min_length=2, max_length=64)]
Range = tuple[Positive, Positive]
Problem = tuple[str, str]
"""A key, and in words what is wrong with it."""


class Movable(Table, frozen=True):
    """What stands at ``centre_m``, or from ``from_s`` on moves along ``waypoints_m``.

    at_end: at the last waypoint it turns "back", and so on to and fro, or it stops.
    """

    centre_m: Triple | None = None
    waypoints_m: Waypoints | None = None
    speed_mps: Annotated[float, Meta(gt=0, le=50)] | None = None
    at_end: Literal["back", "stop"] = "back"
    from_s: Annotated[float, Meta(ge=0, le=86_400)] = 0.0


class Sphere(Movable, frozen=True, tag="sphere", tag_field="shape", kw_only=True):
    """A ball."""

    radius_m: Positive


class Box(Movable, frozen=True, tag="box", tag_field="shape", kw_only=True):
    """A box of that length, width and height, turned about the vertical."""

    size_m: tuple[Positive, Positive, Positive]
    yaw_deg: Degrees = 0.0


class Cylinder(Movable, frozen=True, tag="cylinder", tag_field="shape", kw_only=True):
    """An upright cylinder; its centre is half way up."""

    radius_m: Positive
    height_m: Positive


class Wall(Table, frozen=True, tag="wall", tag_field="shape"):
    """An upright wall; ``from_m`` and ``to_m`` are the ends of the middle of its foot."""

    from_m: Triple
    to_m: Triple
    height_m: Positive
    thickness_m: Positive = 0.1


Obstacle = Sphere | Box | Cylinder | Wall
Obstacles = Annotated[tuple[Obstacle, ...], Meta(max_length=MAX_OBSTACLES)]


class ObstacleField(Table, frozen=True):
    """Random obstacles in a box, drawn by the seed: ``count``, or so many per cubic metre.

    shape: spheres within the box, or cylinders as high as it. corridor_m: least distance between
    two surfaces; clear_of_start_m: from a surface to where vehicles start.
    """

    centre_m: Triple
    size_m: tuple[Extent, Extent, Extent]
    count: Annotated[int, Meta(ge=1, le=MAX_OBSTACLES)] | None = None
    density_per_m3: Positive | None = None
    shape: Literal["sphere", "cylinder"] = "sphere"
    radius_m: Range = (0.3, 0.6)
    corridor_m: Extent = 1.7
    clear_of_start_m: Extent = 1.0

    @property
    def wanted(self) -> int:
        """How many obstacles there shall be."""
        if self.count is not None:
            return self.count
        length, width, height = self.size_m
        return ceil((self.density_per_m3 or 0.0) * length * width * height - 1e-9)


def drawn(field: ObstacleField, start: BoxStart | ListStart, seed: int) -> Iterator[Obstacle]:
    """Yield a field's obstacles; fewer than wanted where the box has no room for more."""
    generator = np.random.Generator(np.random.Philox(key=[seed, FIELD_KEY]))
    placed: list[tuple[Vector, float]] = []
    for _ in range(field.wanted):
        found = _placed(field, start, placed, generator)
        if found is None:
            return
        placed.append(found)
        yield _shaped(field, *found)


def field_problem(field: ObstacleField) -> Problem | None:
    """Return what is wrong with a field as it is written."""
    if (field.count is None) == (field.density_per_m3 is None):
        return "count", "count or density_per_m3; one of the two"
    if field.wanted > MAX_OBSTACLES:
        return "density_per_m3", f"{field.wanted} obstacles; at most {MAX_OBSTACLES}"
    least, most = field.radius_m
    if least > most:
        return "radius_m", f"[{least:g}, {most:g}]; the least first, then the largest"
    return None


def no_room(field: ObstacleField, found: int) -> Problem:
    """Return that a field's box is too small for what it shall hold."""
    size = " x ".join(f"{edge:g}" for edge in field.size_m)
    return (
        "count" if field.count is not None else "density_per_m3",
        f"room for {found} of {field.wanted} obstacles {field.corridor_m:g} m apart in a box of"
        f" {size} m, {field.clear_of_start_m:g} m from the start; fewer, or a smaller corridor_m",
    )


def obstacle_problem(obstacle: Obstacle) -> Problem | None:
    """Return what is wrong with an obstacle as it is written."""
    if isinstance(obstacle, Wall):
        return _wall_problem(obstacle)
    if (obstacle.centre_m is None) == (obstacle.waypoints_m is None):
        return "centre_m", "centre_m where it stands, or waypoints_m along which it moves; one"
    if (obstacle.waypoints_m is None) != (obstacle.speed_mps is None):
        return "speed_mps", "goes with waypoints_m"
    if obstacle.waypoints_m is not None and length(obstacle.waypoints_m) == 0.0:
        return "waypoints_m", "all at one place; leave them out for what stands"
    return None


def length(waypoints: Sequence[Vector]) -> float:
    """Return the length of a line through waypoints [m]."""
    return sum(dist(here, there) for here, there in pairwise(waypoints))


def _wall_problem(wall: Wall) -> Problem | None:
    if wall.from_m[2] != wall.to_m[2]:
        return "to_m", f"height {wall.to_m[2]:g}; that of from_m, {wall.from_m[2]:g}"
    if wall.from_m == wall.to_m:
        return "to_m", "where from_m is; a wall has a length"
    return None


def _placed(
    field: ObstacleField,
    start: BoxStart | ListStart,
    placed: list[tuple[Vector, float]],
    generator: np.random.Generator,
) -> tuple[Vector, float] | None:
    """Return a centre [m; world frame] and a radius [m] with room round it, or None."""
    least, most = field.radius_m
    for _ in range(TRIES):
        across, up, over, share = generator.random(4).tolist()
        radius = least + (most - least) * share
        centre = _within(field, (across - 0.5, up - 0.5, over - 0.5))
        if _clear(field, start, placed, centre, radius):
            return centre, radius
    return None


def _within(field: ObstacleField, share: Vector) -> Vector:
    (x, y, z), (length_m, width_m, height_m) = field.centre_m, field.size_m
    level = field.shape == "cylinder"
    return (
        x + length_m * share[0],
        y + width_m * share[1],
        z if level else z + height_m * share[2],
    )


def _clear(
    field: ObstacleField,
    start: BoxStart | ListStart,
    placed: list[tuple[Vector, float]],
    centre: Vector,
    radius: float,
) -> bool:
    others = all(dist(centre, c) - radius - r >= field.corridor_m for c, r in placed)
    return others and _from_start(field, start, centre) - radius >= field.clear_of_start_m


def _from_start(field: ObstacleField, start: BoxStart | ListStart, centre: Vector) -> float:
    """Return how far an obstacle's axis or centre is from where vehicles start [m]."""
    flat = field.shape == "cylinder"
    if isinstance(start, ListStart):
        return min(_apart(centre, position, flat) for position in start.positions_m)
    nearest = tuple(
        min(max(c, middle - 0.5 * size), middle + 0.5 * size)
        for c, middle, size in zip(centre, start.centre_m, start.size_m, strict=True)
    )
    return _apart(centre, (nearest[0], nearest[1], nearest[2]), flat)


def _apart(one: Vector, other: Vector, flat: bool) -> float:
    return hypot(one[0] - other[0], one[1] - other[1]) if flat else dist(one, other)


def _shaped(field: ObstacleField, centre: Vector, radius: float) -> Obstacle:
    if field.shape == "sphere":
        return Sphere(centre_m=centre, radius_m=radius)
    return Cylinder(centre_m=centre, radius_m=radius, height_m=field.size_m[2])


def resolved(
    field: ObstacleField, start: BoxStart | ListStart, seed: int
) -> tuple[tuple[Obstacle, ...], Problem | None]:
    """Return a field's obstacles, and what is wrong with it if anything is."""
    broken = field_problem(field)
    if broken is not None:
        return (), broken
    found = tuple(drawn(field, start, seed))
    return found, no_room(field, len(found)) if len(found) < field.wanted else None
