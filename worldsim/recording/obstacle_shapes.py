"""Obstacles in a recording: solid shapes that last, and for those that move a place at each tick.

What lasts and what moves stand under entities of their own: of one entity, what lasts hides what
changes.
"""

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from worldsim.judge.tick import Tick
from worldsim.recording import layout, palette
from worldsim.recording.columns import ColumnBlock
from worldsim.truth.obstacles import Obstacles

Rows = NDArray[np.intp]


class Shapes:
    """A scenario's obstacles as rerun's shapes; boxes stand for walls too."""

    def __init__(self, obstacles: Obstacles) -> None:
        self._obstacles = obstacles
        kinds = (
            ("spheres", obstacles.spheres, rr.Ellipsoids3D),
            ("cylinders", obstacles.cylinders, rr.Cylinders3D),
            ("boxes", obstacles.boxes, rr.Boxes3D),
        )
        self._still = list(_some(layout.OBSTACLES, kinds, ~obstacles.moves))
        self._moving = list(_some(layout.MOVING, kinds, obstacles.moves))

    def lasting(self) -> Iterator[tuple[str, list[Any]]]:
        """Return what holds for the whole run, entity by entity."""
        centres = self._obstacles.centres(0.0)
        for entity, rows, kind in self._still:
            form = {**self._form(kind, rows), "centers": centres[rows]}
            yield entity, [kind.from_fields(**form)]
        for entity, rows, kind in self._moving:
            yield entity, [kind.from_fields(**self._form(kind, rows))]

    def sheets(self, ticks: Sequence[Tick]) -> Iterator[ColumnBlock]:
        """Return where those that move are, at every tick of a block."""
        if not self._moving:
            return
        centres = np.stack([self._obstacles.centres(tick.time_s) for tick in ticks])
        for entity, rows, kind in self._moving:
            columns = kind.columns(centers=centres[:, rows].reshape(-1, 3))
            yield ColumnBlock(
                entity, range(len(ticks)), columns.partition([len(rows)] * len(ticks))
            )

    def _form(self, kind: Any, rows: Rows) -> dict[str, Any]:
        radius, half = self._obstacles.radius[rows], self._obstacles.half[rows]
        look = {"colors": [palette.OBSTACLE], "fill_mode": rr.components.FillMode.Solid}
        if kind is rr.Ellipsoids3D:
            return {**look, "half_sizes": np.repeat(radius[:, None], 3, axis=1)}
        if kind is rr.Cylinders3D:
            return {**look, "radii": radius, "lengths": 2.0 * half[:, 2]}
        cosine, sine = self._obstacles.heading[rows].T
        yaw = np.arctan2(sine, cosine)
        none = np.zeros(len(rows))
        turned = np.stack((none, none, np.sin(0.5 * yaw), np.cos(0.5 * yaw)), axis=1)
        return {**look, "half_sizes": half, "quaternions": turned}


def _some(
    under: str, kinds: Sequence[tuple[str, Rows, Any]], which: NDArray[np.bool_]
) -> Iterator[tuple[str, Rows, Any]]:
    """Yield entity, rows and kind of those kinds of which there are any."""
    for name, rows, kind in kinds:
        chosen = rows[which[rows]]
        if len(chosen):
            yield f"{under}/{name}", chosen, kind
