"""A block of ticks as columns: poses, metrics, state, colours, links and packet counters.

Values that change at every tick have a row for every tick. Values that change rarely (colours,
missions, links, counters) have a row where they changed; a viewer shows the latest.
"""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from worldsim.judge.tick import Float32s, Tick
from worldsim.judge.verdict import Figures
from worldsim.recording import components, layout, palette
from worldsim.recording.agent_colours import AgentColours
from worldsim.recording.columns import ChangeDetector, ColumnBlock
from worldsim.recording.components import number_column
from worldsim.recording.link_columns import LinkColumns
from worldsim.recording.situation import Situation
from worldsim.truth.vehicle import Floats

ARROW_RADII = 2.6
"""Length of the arrow that shows a vehicle's heading [radii of the vehicle]."""
SPARSE_TICKS, POSE_TICKS = 4, 2
"""What only viewers need of a large fleet is recorded at one tick of so many; and their poses."""


class TickColumns:
    """Makes the columns of one block of ticks after the other.

    tick_hz: ticks in a second. limits: the reference lines of each metric, in its unit. radius_m
    (N,): of each vehicle.
    """

    def __init__(
        self,
        colours: AgentColours,
        tick_hz: float,
        limits: Mapping[str, list[float]],
        radius_m: Floats,
    ) -> None:
        self._arrow_m = ARROW_RADII * radius_m
        self._colours = colours
        self._limits = limits
        self._links = LinkColumns(tick_hz)
        self._colour_changes = ChangeDetector()
        self._series_changes = ChangeDetector()
        self._mission_changes = ChangeDetector()
        self._counter_changes: dict[str, ChangeDetector] = {}
        self._agent_metrics = layout.agent_metrics(obstacles=layout.OBSTACLE_DISTANCE in limits)

    def blocks(
        self,
        ticks: Sequence[Tick],
        figures: Sequence[Figures],
        situations: Sequence[Situation],
    ) -> Iterator[ColumnBlock]:
        """Yield the columns of a block; blocks come in order."""
        yield from _poses(ticks)
        yield from self._headings(ticks)
        yield from _judged_metrics(ticks)
        if len(ticks[0].alive) <= layout.NAMED_MAX:
            yield from _distances(ticks, figures)
        yield _state(ticks)
        yield from self._missions(ticks)
        yield from self._coloured_entities(ticks, [each.dead for each in situations])
        yield from self._links.blocks(ticks, situations)

    def detail(self, ticks: Sequence[Tick], figures: Sequence[Figures]) -> Iterator[ColumnBlock]:
        """Yield what hardly changes or has a lower rate, of some ticks that were sent."""
        if len(ticks[0].alive) > layout.NAMED_MAX:
            yield from _distances(ticks, figures)
        yield from self._links.detail(ticks)
        yield from self._packets(ticks)
        yield from self._reference_lines(len(ticks) - 1)
        series = self._colours.series()
        if self._series_changes.changed_rows(series[None]):
            latest = rr.SeriesLines.columns(colors=series).partition([len(series)])
            for entity in self._agent_metrics:
                yield ColumnBlock(entity, (), latest)

    def _headings(self, ticks: Sequence[Tick]) -> Iterator[ColumnBlock]:
        """Yield an arrow ahead of each vehicle; of a large fleet, at some ticks only."""
        rows = _sparse_rows(ticks)
        if rows:
            attitude = np.stack([ticks[row].attitude for row in rows])
            yaw, pitch = attitude[..., 0], attitude[..., 1]
            level = np.cos(pitch)
            ahead = np.stack((level * np.cos(yaw), level * np.sin(yaw), np.sin(pitch)), axis=2)
            origins = np.stack([ticks[row].position for row in rows])
            columns = [
                components.ARROW_ORIGINS.rows(origins),
                components.ARROW_VECTORS.rows(ahead * self._arrow_m[:, None]),
            ]
            yield ColumnBlock(layout.VEHICLES, rows, columns)

    def _coloured_entities(
        self, ticks: Sequence[Tick], dead: Sequence[NDArray[np.bool_]]
    ) -> Iterator[ColumnBlock]:
        colours = self._colours.vehicles(ticks, dead)
        yield from _trails(ticks, colours)
        rows = self._colour_changes.changed_rows(colours)
        if rows:
            changed = colours[rows]
            yield ColumnBlock(layout.VEHICLES, rows, [components.BOX_COLOURS.rows(changed)])
            yield ColumnBlock(layout.TARGETS, rows, [components.POINT_COLOURS.rows(changed)])

    def _missions(self, ticks: Sequence[Tick]) -> Iterator[ColumnBlock]:
        series = np.stack([tick.mission for tick in ticks])
        rows = self._mission_changes.changed_rows(series)
        if rows:
            columns = [number_column(layout.MISSION, series[rows])]
            yield ColumnBlock(layout.AGENT_STATE, rows, columns)

    def _packets(self, ticks: Sequence[Tick]) -> Iterator[ColumnBlock]:
        for counter in dict.fromkeys(counter for tick in ticks for counter in tick.packets):
            # A missing counter is not zero: I8 is not evaluated before the first counters come.
            known = [row for row, tick in enumerate(ticks) if counter in tick.packets]
            counts = np.array([ticks[row].packets[counter] for row in known], dtype=np.float64)
            detector = self._counter_changes.setdefault(counter, ChangeDetector())
            changed = detector.changed_rows(counts)
            if changed:
                rows = [known[at] for at in changed]
                columns = [components.SCALARS.rows(counts[changed, None])]
                yield ColumnBlock(layout.packet_entity(counter), rows, columns)

    def _reference_lines(self, last: int) -> Iterator[ColumnBlock]:
        """Yield the reference lines from the first to the last row."""
        rows = sorted({0, last})
        for metric, values in self._limits.items():
            columns = [components.SCALARS.rows(np.array([values] * len(rows)))]
            yield ColumnBlock(layout.limit_entity(metric), rows, columns)


def _sparse_rows(ticks: Sequence[Tick], of_large: int = SPARSE_TICKS) -> list[int]:
    """Return the rows of a block at which what only viewers need is recorded.

    Of a large fleet it is one tick of so many.
    """
    step = 1 if len(ticks[0].alive) <= layout.NAMED_MAX else of_large
    return [row for row, tick in enumerate(ticks) if tick.index % step == 0]


def _trails(ticks: Sequence[Tick], colours: palette.Colours) -> Iterator[ColumnBlock]:
    """Yield positions, each with its colour: a trail shows the colour of each past position."""
    rows = _sparse_rows(ticks)
    if rows:
        position = np.stack([ticks[row].position for row in rows])
        columns = [
            components.POINTS.rows(position),
            components.POINT_COLOURS.rows(_of_trails(colours[rows])),
        ]
        yield ColumnBlock(layout.AGENTS, rows, columns)


def _of_trails(colours: palette.Colours) -> palette.Colours:
    """Return the colours of trails: the red of distress is for vehicles, not for a way flown."""
    shown: palette.Colours = np.where(colours == palette.IN_DISTRESS, palette.UNPLACED, colours)
    return shown


def _poses(ticks: Sequence[Tick]) -> Iterator[ColumnBlock]:
    rows = _sparse_rows(ticks, POSE_TICKS)
    if rows:
        attitude = _quaternions(np.stack([ticks[row].attitude for row in rows]))
        boxes = [
            components.BOX_CENTRES.rows(np.stack([ticks[row].position for row in rows])),
            components.BOX_QUATERNIONS.rows(attitude),
        ]
        yield ColumnBlock(layout.VEHICLES, rows, boxes)
    targets = [components.POINTS.rows(np.stack([tick.target for tick in ticks]))]
    yield ColumnBlock(layout.TARGETS, range(len(ticks)), targets)


def _quaternions(attitude: Float32s) -> Float32s:
    """Return xyzw (T, N, 4) of yaw, pitch (nose up) and roll (right side down), in that order.

    attitude (T, N, 3) [rad].
    """
    half = 0.5 * np.moveaxis(attitude, -1, 0)
    (sy, sp, sr), (cy, cp, cr) = np.sin(half), np.cos(half)
    sp = -sp  # x is ahead, y left and z up: a negative turn about y raises the nose
    return np.stack(
        [
            cy * cp * sr - sy * sp * cr,
            cy * sp * cr + sy * cp * sr,
            sy * cp * cr - cy * sp * sr,
            cy * cp * cr + sy * sp * sr,
        ],
        axis=2,
    ) + np.float32(0.0)  # no negative zeros: equal rows of a level fleet compress well


def _judged_metrics(ticks: Sequence[Tick]) -> Iterator[ColumnBlock]:
    """Yield agents' metrics that a reader cannot compute from the rest, at every tick."""
    every = range(len(ticks))
    yield ColumnBlock(layout.FORCE, every, [_scalars([tick.force for tick in ticks])])
    yield ColumnBlock(layout.TURN_DEG, every, [_scalars([tick.turn_deg for tick in ticks])])


def _distances(ticks: Sequence[Tick], figures: Sequence[Figures]) -> Iterator[ColumnBlock]:
    """Yield agents' distances, for viewers only; of a large fleet, at some ticks."""
    sparse = _sparse_rows(ticks)
    distance = [(row, figures[row].obstacle_distance) for row in sparse]
    near = {row: each for row, each in distance if each is not None}
    for entity, rows, values in (
        (layout.SEPARATION, sparse, [figures[row].separation for row in sparse]),
        (layout.SLOT_ERROR, sparse, [_finite(figures[row].slot_error) for row in sparse]),
        (layout.OBSTACLE_DISTANCE, list(near), list(near.values())),
    ):
        if rows:
            yield ColumnBlock(entity, rows, [_scalars(values)])


def _scalars(values: Sequence[NDArray[Any]]) -> rr.ComponentColumn:
    return components.SCALARS.rows(np.stack(values))


def _finite(values: Floats) -> Floats:
    return np.where(np.isfinite(values), values, np.nan)


def _state(ticks: Sequence[Tick]) -> ColumnBlock:
    """Return what a judge needs to repeat the verdict and no view shows."""
    columns = [
        number_column(layout.POSITION, np.stack([tick.position for tick in ticks])),
        number_column(layout.PLACE, np.stack([tick.place for tick in ticks])),
        number_column(layout.ALIVE, np.stack([tick.alive for tick in ticks]).astype(np.uint8)),
        number_column(layout.ATTITUDE, np.stack([tick.attitude for tick in ticks])),
    ]
    return ColumnBlock(layout.AGENT_STATE, range(len(ticks)), columns)
