"""The camera's own frame: it follows the team and zooms so that every running agent is in view.

The 3D view is drawn in the coordinates of this frame. Its origin lies amid the running agents, and
its unit of length is the distance of the farthest of them and of their targets: a camera at rest in
it shows the team at every time. Targets far beyond the team are out of view, lest the team is a
dot. The unit grows at once and shrinks slowly, so that the picture is calm. The ground is a grid
that rests in the world: it moves by whole cells, to stay below the team.
"""

from collections.abc import Iterator, Sequence
from math import ceil, exp, floor, isfinite, log10
from typing import Any

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from worldsim.judge.tick import Tick
from worldsim.recording import layout, palette
from worldsim.recording.columns import ColumnBlock
from worldsim.recording.components import SCALES, TRANSLATIONS
from worldsim.truth.vehicle import Floats

LEAST_RADIUS_M = 1.5
TARGETS_WITHIN = 1.5
"""Targets are in view up to this distance [distances of the farthest agent]."""
MARGIN = 1.08
"""The view's radius to the distance of the farthest agent."""
FOLLOW_S = 1.0
"""Time constant with which the centre follows the team."""
SHRINK_S = 4.0
"""Time constant with which the radius shrinks."""
CELLS = 14
"""Cells of the ground from its centre to each side."""
BELOW = 0.8
"""Height of the view's centre over the ground [radii]."""
CELL = 0.3
"""Least size of a cell [radii]."""
LINE_RADIUS = 0.0012  # [radii]


class TeamView:
    """Follows the team from tick to tick."""

    def __init__(self, tick_s: float) -> None:
        self._follow = 1.0 - exp(-tick_s / FOLLOW_S)
        self._shrink = exp(-tick_s / SHRINK_S)
        self._centre: list[float] | None = None
        self._radius_m = LEAST_RADIUS_M
        self._cell_m = 0.0
        self._corner: tuple[int, int, int] | None = None
        """Of the ground's middle, in cells; None before the first tick."""

    def blocks(self, ticks: Sequence[Tick]) -> Iterator[ColumnBlock]:
        """Yield the view's transforms and the ground of a block of ticks; blocks come in order."""
        team = _team(ticks)
        centres = self._centres(team)
        radii_m = self._radii_m(ticks, team, centres)
        scales = np.repeat(radii_m[:, None, None], 3, axis=2)
        columns = [TRANSLATIONS.rows(centres[:, None]), SCALES.rows(scales)]
        yield ColumnBlock(layout.TEAM, range(len(ticks)), columns)
        rows, places = [], []
        for row, (centre, radius_m) in enumerate(
            zip(centres.tolist(), radii_m.tolist(), strict=True)
        ):
            cell_m = self._cell_m
            place = self._ground(centre, radius_m)
            if place is not None:
                rows.append(row)
                places.append(place)
            if self._cell_m != cell_m:
                yield _grid(row, self._cell_m)
        if rows:
            yield ColumnBlock(layout.GROUND, rows, [TRANSLATIONS.rows(np.array(places)[:, None])])

    def _centres(self, team: Floats) -> Floats:
        """Return the view's centre at each tick (T, 3) [m; world frame]."""
        middles: Floats = 0.5 * (_least(team) + _most(team))
        centres = np.zeros((len(team), 3))
        centre = self._centre
        for row, middle in enumerate(middles.tolist()):
            if all(map(isfinite, middle)):
                before = middle if centre is None else centre
                pairs = zip(before, middle, strict=True)
                centre = [was + self._follow * (now - was) for was, now in pairs]
            centres[row] = 0.0 if centre is None else centre
        self._centre = centre
        return centres

    def _radii_m(self, ticks: Sequence[Tick], team: Floats, centres: Floats) -> Floats:
        """Return the view's radius at each tick (T,) [m]."""
        targets = _by_coordinate([tick.target for tick in ticks])
        alive = np.stack([tick.alive for tick in ticks])
        aims = targets if alive.all() else np.where(alive[:, None, :], targets, np.nan)
        team_m, aims_m = _reach(team, centres), _reach(aims, centres)
        least_m = np.maximum(team_m, LEAST_RADIUS_M)
        reach_m = np.maximum(team_m, np.minimum(aims_m, TARGETS_WITHIN * least_m))
        radii_m = np.zeros(len(ticks))
        for row, reached_m in enumerate(reach_m.tolist()):
            shrunk_m = self._radius_m * self._shrink
            self._radius_m = max(MARGIN * reached_m, shrunk_m, LEAST_RADIUS_M)
            radii_m[row] = self._radius_m
        return radii_m

    def _ground(self, centre: Sequence[float], radius_m: float) -> Floats | None:
        """Return where the ground is now (3,) [m; world frame]; None where nothing changes."""
        cell_m = self._cell_m
        if not CELL * radius_m <= cell_m <= 2.6 * CELL * radius_m:
            cell_m = _round_length(CELL * radius_m)
        x, y, z = centre
        height, last = (z - BELOW * radius_m) / cell_m, self._corner
        corner = (round(x / cell_m), round(y / cell_m), floor(height))
        if cell_m == self._cell_m and last is not None:
            # The height is kept for a cell more, lest the ground jumps with every breath.
            level = last[2] if 0.0 <= height - last[2] + 1.0 <= 3.0 else corner[2]
            corner = (*corner[:2], level)
            if corner == last:
                return None
        self._cell_m, self._corner = cell_m, corner
        place: Floats = np.array(corner, dtype=np.float64) * cell_m
        return place


def _team(ticks: Sequence[Tick]) -> Floats:
    """Return the positions of running agents (T, 3, N) [m; world frame], NaN for the others.

    Where none is running, those of all vehicles.
    """
    position = _by_coordinate([tick.position for tick in ticks])
    running = np.stack([tick.alive for tick in ticks])
    if running.all():
        return position
    seen = running & np.isfinite(position).all(axis=1)
    running[~np.any(seen, axis=1)] = True
    team: Floats = np.where(running[:, None, :], position, np.nan)
    return team


def _by_coordinate(points: Sequence[NDArray[Any]]) -> Floats:
    """Return points (N, 3) of some ticks as (T, 3, N), one coordinate after the other."""
    return np.ascontiguousarray(np.stack(points).transpose(0, 2, 1), dtype=np.float64)


def _reach(points: Floats, centres: Floats) -> Floats:
    """Return how far the farthest of points (T, 3, N) is from a centre (T, 3), NaN left out."""
    away = points - centres[:, :, None]
    np.square(away, out=away)
    most = _most(away[:, 0] + away[:, 1] + away[:, 2])
    reach: Floats = np.sqrt(np.where(np.isnan(most), 0.0, most))
    return reach


def _least(values: Floats) -> Floats:
    """Return the least along the last axis, NaN left out; NaN where there is nothing else."""
    least: Floats = values.min(axis=-1)
    # Much faster than to look for NaN at once: as a rule there is none.
    return np.fmin.reduce(values, axis=-1) if np.isnan(least).any() else least


def _most(values: Floats) -> Floats:
    """Return the greatest along the last axis, as _least does."""
    most: Floats = values.max(axis=-1)
    return np.fmax.reduce(values, axis=-1) if np.isnan(most).any() else most


def _round_length(least_m: float) -> float:
    """Return the least of 1, 2, 5, 10 ... (or 0.5, 0.2 ...) that is no less [m]."""
    power = 10.0 ** (ceil(log10(least_m)) - 1)
    return next(step * power for step in (1.0, 2.0, 5.0, 10.0) if step * power >= least_m - 1e-9)


def _grid(row: int, cell_m: float) -> ColumnBlock:
    ends = CELLS * cell_m
    at = np.linspace(-ends, ends, 2 * CELLS + 1)
    along_x = [[(-ends, y, 0.0), (ends, y, 0.0)] for y in at]
    along_y = [[(x, -ends, 0.0), (x, ends, 0.0)] for x in at]
    lines = rr.LineStrips3D.columns(
        strips=[*along_x, *along_y],
        colors=[int(palette.GROUND)] * (2 * len(at)),
        radii=[LINE_RADIUS * cell_m / CELL] * (2 * len(at)),
    )
    return ColumnBlock(layout.GROUND, [row], lines.partition([2 * len(at)]))
