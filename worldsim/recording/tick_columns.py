"""A second of ticks as sheets of columns: what of a run goes under which entity, at which ticks.

What changes at every tick has a row for every tick; what seldom changes (colours, who hears whom,
counters) has a row where it changed, and a viewer shows the latest.
"""

from collections.abc import Iterator, Mapping, Sequence

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from agent.comms.hierarchy import DISTRESS
from worldsim.judge.tick import Singles, Tick
from worldsim.judge.verdict import Figures
from worldsim.recording import layout, palette
from worldsim.recording.columns import ColumnBlock, Latest, numbers
from worldsim.recording.link_columns import HearingSheets


class TickColumns:
    """Makes the sheets of one block of ticks after the other.

    shared: (K, 2), the places that queues have in common. tick_hz: ticks in a second. limits: for
    each metric its reference lines.
    """

    def __init__(
        self, shared: NDArray[np.int16], tick_hz: float, limits: Mapping[str, list[float]]
    ) -> None:
        self._shared = shared
        self._limits = limits
        self._colours = Latest()
        self._hearing = HearingSheets(tick_hz)
        self._flown = Latest()
        self._counters: dict[str, Latest] = {}
        near = layout.OBSTACLE_DISTANCE in limits
        self._per_agent = (*(layout.NEAR_OBSTACLES if near else layout.PER_AGENT), *layout.TOLD)

    def of(self, ticks: Sequence[Tick], figures: Sequence[Figures]) -> Iterator[ColumnBlock]:
        """Return the sheets of a block; blocks come in order."""
        yield from _poses(ticks)
        yield from _metrics(ticks, figures)
        yield _state(ticks)
        yield from self._missions(ticks)
        yield from self._coloured(ticks)
        yield from self._hearing.of(ticks)
        yield from self._packets(ticks)
        yield from self._references(len(ticks) - 1)

    def _coloured(self, ticks: Sequence[Tick]) -> Iterator[ColumnBlock]:
        series = self._colours_of(ticks)
        rows = self._colours.changes(series)
        yield _trail(ticks, series.ravel())
        if not rows:
            return
        counts = [series.shape[1]] * len(rows)
        changed = series[rows].ravel()
        for entity, archetype in ((layout.VEHICLES, rr.Boxes3D), (layout.TARGETS, rr.Points3D)):
            yield ColumnBlock(entity, rows, archetype.columns(colors=changed).partition(counts))
        lasting = rr.SeriesLines.columns(colors=series[rows[-1]]).partition(counts[:1])
        for entity in self._per_agent:
            yield ColumnBlock(entity, (), lasting)

    def _colours_of(self, ticks: Sequence[Tick]) -> palette.Colours:
        """Return colours (T, N): those of agents' queues, but for the distressed and the dead."""
        colours = palette.of_places(np.concatenate([tick.place for tick in ticks]), self._shared)
        colours = colours.reshape(len(ticks), -1)
        for row, tick in enumerate(ticks):
            if tick.standings is not None:
                colours[row, tick.standings.role == DISTRESS] = palette.DISTRESS
            colours[row, ~tick.alive] = palette.DEAD
        return colours

    def _missions(self, ticks: Sequence[Tick]) -> Iterator[ColumnBlock]:
        series = np.stack([tick.mission for tick in ticks])
        rows = self._flown.changes(series)
        if rows:
            yield ColumnBlock(layout.MISSIONS, rows, [numbers(layout.MISSION, series[rows])])

    def _packets(self, ticks: Sequence[Tick]) -> Iterator[ColumnBlock]:
        for cause in dict.fromkeys(cause for tick in ticks for cause in tick.packets):
            # What was not told yet is no zero: I8 is not looked at before the first counters.
            told = [row for row, tick in enumerate(ticks) if cause in tick.packets]
            counts = np.array([ticks[row].packets[cause] for row in told], dtype=np.float64)
            changes = self._counters.setdefault(cause, Latest()).changes(counts)
            if changes:
                rows = [told[at] for at in changes]
                columns = rr.Scalars.columns(scalars=counts[changes])
                yield ColumnBlock(f"{layout.PACKETS}/{cause}", rows, columns)

    def _references(self, last: int) -> Iterator[ColumnBlock]:
        """Return the reference lines, drawn on as far as the block goes."""
        rows = sorted({0, last})
        for metric, values in self._limits.items():
            columns = rr.Scalars.columns(scalars=values * len(rows))
            yield ColumnBlock(
                layout.limit_of(metric), rows, columns.partition([len(values)] * len(rows))
            )


def _trail(ticks: Sequence[Tick], colours: palette.Colours) -> ColumnBlock:
    """Return positions with their colours: of a range of time, a viewer shows each as it was."""
    position = np.concatenate([tick.position for tick in ticks])
    columns = rr.Points3D.columns(positions=position, colors=colours)
    counts = [len(ticks[0].alive)] * len(ticks)
    return ColumnBlock(layout.AGENTS, range(len(ticks)), columns.partition(counts))


def _poses(ticks: Sequence[Tick]) -> Iterator[ColumnBlock]:
    rows, counts = range(len(ticks)), [len(ticks[0].alive)] * len(ticks)
    position = np.concatenate([tick.position for tick in ticks])
    attitude = _quaternions(np.concatenate([tick.attitude for tick in ticks]))
    target = np.concatenate([tick.target for tick in ticks])
    boxes = rr.Boxes3D.columns(centers=position, quaternions=attitude)
    yield ColumnBlock(layout.VEHICLES, rows, boxes.partition(counts))
    yield ColumnBlock(layout.TARGETS, rows, rr.Points3D.columns(positions=target).partition(counts))


def _quaternions(attitude: Singles) -> Singles:
    """Return xyzw of yaw, pitch (nose up) and roll (right side down), turned in that order."""
    (sy, sp, sr), (cy, cp, cr) = np.sin(0.5 * attitude.T), np.cos(0.5 * attitude.T)
    sp = -sp  # z is up and x ahead, so the nose rises by a negative turn about y, the left
    return np.stack(
        [
            cy * cp * sr - sy * sp * cr,
            cy * sp * cr + sy * cp * sr,
            sy * cp * cr - cy * sp * sr,
            cy * cp * cr + sy * sp * sr,
        ],
        axis=1,
    ) + np.float32(0.0)  # no negative zeros: a level fleet's are all alike, and packed as one


def _metrics(ticks: Sequence[Tick], figures: Sequence[Figures]) -> Iterator[ColumnBlock]:
    counts = [len(ticks[0].alive)] * len(ticks)
    near = [seen.obstacle_distance for seen in figures if seen.obstacle_distance is not None]
    for entity, series in (
        (layout.FORCE, [tick.force for tick in ticks]),
        (layout.TURN_DEG, [tick.turn_deg for tick in ticks]),
        (layout.SEPARATION, [seen.separation for seen in figures]),
        (layout.SLOT_ERROR, [seen.slot_error for seen in figures]),
        *([(layout.OBSTACLE_DISTANCE, near)] if near else ()),
    ):
        values = np.concatenate(series)
        if entity == layout.SLOT_ERROR:
            values = np.where(np.isfinite(values), values, np.nan)
        columns = rr.Scalars.columns(scalars=values).partition(counts)
        yield ColumnBlock(entity, range(len(ticks)), columns)


def _state(ticks: Sequence[Tick]) -> ColumnBlock:
    """Return what the judge or a reader needs and no view shows."""
    columns = [
        numbers(layout.PLACE, np.stack([tick.place for tick in ticks])),
        numbers(layout.ALIVE, np.stack([tick.alive for tick in ticks]).astype(np.uint8)),
        numbers(layout.ATTITUDE, np.stack([tick.attitude for tick in ticks])),
    ]
    return ColumnBlock(layout.STATE, range(len(ticks)), columns)
