"""Entities of a scenario's obstacles: static shapes, and positions at each tick of moving ones.

Resting and moving obstacles have separate entities, because static data of an entity hides data
that changes.
"""

from collections.abc import Iterator, Sequence
from typing import NamedTuple, Protocol

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from worldsim.judge.tick import Tick
from worldsim.recording import layout, palette
from worldsim.recording.columns import ColumnBlock, Entity
from worldsim.truth.obstacles import Obstacles
from worldsim.truth.vehicle import Floats

Rows = NDArray[np.intp]
COLOURS = [palette.OBSTACLE]
SOLID = rr.components.FillMode.Solid


class ObstacleEntities:
    """Draws the obstacles of a run; walls are drawn as boxes."""

    def __init__(self, obstacles: Obstacles) -> None:
        self._obstacles = obstacles
        self._resting = list(_groups(obstacles, layout.OBSTACLES, ~obstacles.moves))
        self._moving = list(_groups(obstacles, layout.MOVING_OBSTACLES, obstacles.moves))

    def static(self) -> Iterator[Entity]:
        """Yield what is logged once: resting obstacles whole, moving ones without positions."""
        centres = self._obstacles.centres(0.0)
        for group in self._resting:
            shape = group.kind.shape(self._obstacles, group.rows, centres[group.rows])
            yield Entity(group.entity, shape)
        for group in self._moving:
            yield Entity(group.entity, group.kind.shape(self._obstacles, group.rows, None))

    def blocks(self, ticks: Sequence[Tick]) -> Iterator[ColumnBlock]:
        """Yield the positions of moving obstacles at every tick of a block."""
        if not self._moving:
            return
        centres = np.stack([self._obstacles.centres(tick.time_s) for tick in ticks])
        for entity, rows, kind in self._moving:
            columns = kind.positions(centres[:, rows].reshape(-1, 3))
            yield ColumnBlock.of_batches(entity, range(len(ticks)), columns, len(rows))


class _Kind(Protocol):
    """How one kind of obstacle is drawn."""

    def shape(self, obstacles: Obstacles, rows: Rows, centres: Floats | None) -> rr.AsComponents:
        """Return the shapes of some obstacles; centres (K, 3) [m; world frame], None to omit."""

    def positions(self, centres: Floats) -> rr.ComponentColumnList:
        """Return centres (T * K, 3) [m; world frame] as columns."""


class _Spheres:
    def shape(self, obstacles: Obstacles, rows: Rows, centres: Floats | None) -> rr.Ellipsoids3D:
        half_sizes = np.repeat(obstacles.radius[rows][:, None], 3, axis=1)
        return rr.Ellipsoids3D.from_fields(
            centers=centres, half_sizes=half_sizes, colors=COLOURS, fill_mode=SOLID
        )

    def positions(self, centres: Floats) -> rr.ComponentColumnList:
        return rr.Ellipsoids3D.columns(centers=centres)


class _Cylinders:
    def shape(self, obstacles: Obstacles, rows: Rows, centres: Floats | None) -> rr.Cylinders3D:
        return rr.Cylinders3D.from_fields(
            centers=centres,
            radii=obstacles.radius[rows],
            lengths=2.0 * obstacles.half[rows, 2],
            colors=COLOURS,
            fill_mode=SOLID,
        )

    def positions(self, centres: Floats) -> rr.ComponentColumnList:
        return rr.Cylinders3D.columns(centers=centres)


class _Boxes:
    def shape(self, obstacles: Obstacles, rows: Rows, centres: Floats | None) -> rr.Boxes3D:
        return rr.Boxes3D.from_fields(
            centers=centres,
            half_sizes=obstacles.half[rows],
            quaternions=_upright_quaternions(obstacles.heading[rows]),
            colors=COLOURS,
            fill_mode=SOLID,
        )

    def positions(self, centres: Floats) -> rr.ComponentColumnList:
        return rr.Boxes3D.columns(centers=centres)


class _Group(NamedTuple):
    """Obstacles that share an entity."""

    entity: str
    rows: Rows  # columns of Obstacles
    kind: _Kind


def _groups(obstacles: Obstacles, parent: str, chosen: NDArray[np.bool_]) -> Iterator[_Group]:
    """Yield a group for each kind of which there are chosen obstacles; chosen (M,)."""
    kinds: tuple[tuple[str, Rows, _Kind], ...] = (
        ("spheres", obstacles.spheres, _Spheres()),
        ("cylinders", obstacles.cylinders, _Cylinders()),
        ("boxes", obstacles.boxes, _Boxes()),
    )
    for name, rows, kind in kinds:
        if len(some := rows[chosen[rows]]):
            yield _Group(f"{parent}/{name}", some, kind)


def _upright_quaternions(heading: Floats) -> Floats:
    """Return xyzw (K, 4) of turns about the vertical; heading (K, 2): cosine and sine."""
    cosine, sine = heading.T
    yaw = np.arctan2(sine, cosine)
    zero = np.zeros(len(yaw))
    return np.stack((zero, zero, np.sin(0.5 * yaw), np.cos(0.5 * yaw)), axis=1)
