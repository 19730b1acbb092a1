"""A second of ticks as sheets of columns: what of a run goes under which entity, at which ticks.

What changes at every tick has a row for every tick; what seldom changes (colours, who hears whom,
counters) has a row where it changed, and a viewer shows the latest.
"""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
import rerun as rr
from numpy.typing import NDArray
from pyarrow.lib import array as arrow_array

from agent.comms.hierarchy import DISTRESS
from worldsim.judge.tick import Singles, Tick
from worldsim.judge.verdict import Figures
from worldsim.show import layout, palette
from worldsim.show.sheet import Latest, Sheet, Thinned

LINES_MAX = 400
LINES_PER_S = 2000
"""More lines than these at once, or in a second, would cost more than all the rest together."""


class Sheets:
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
        self._heard = Latest()
        self._flown = Latest()
        self._counters: dict[str, Latest] = {}
        self._drawn = Thinned(tick_hz, LINES_PER_S)
        near = layout.OBSTACLE_DISTANCE in limits
        self._per_agent = (*(layout.NEAR_OBSTACLES if near else layout.PER_AGENT), *layout.TOLD)

    def of(self, ticks: Sequence[Tick], figures: Sequence[Figures]) -> Iterator[Sheet]:
        """Return the sheets of a block; blocks come in order."""
        yield from _poses(ticks)
        yield from _metrics(ticks, figures)
        yield _state(ticks)
        yield from self._missions(ticks)
        yield from self._coloured(ticks)
        yield from self._hearing(ticks)
        yield from self._lines(ticks)
        yield from self._packets(ticks)
        yield from self._references(len(ticks) - 1)

    def _coloured(self, ticks: Sequence[Tick]) -> Iterator[Sheet]:
        series = [self._colours_at(tick) for tick in ticks]
        rows = self._colours.changes(series)
        yield _trail(ticks, np.concatenate(series))
        if not rows:
            return
        colours = np.concatenate([series[row] for row in rows])
        counts = [len(series[0])] * len(rows)
        for entity, archetype in ((layout.VEHICLES, rr.Boxes3D), (layout.TARGETS, rr.Points3D)):
            yield Sheet(entity, rows, archetype.columns(colors=colours).partition(counts))
        lasting = rr.SeriesLines.columns(colors=series[rows[-1]]).partition(counts[:1])
        for entity in self._per_agent:
            yield Sheet(entity, (), lasting)

    def _colours_at(self, tick: Tick) -> palette.Colours:
        """Return agents' colours (N,): their queues', but for those in distress and the dead."""
        colours = palette.of_places(tick.place, self._shared)
        if tick.standings is not None:
            colours = np.where(tick.standings.role == DISTRESS, palette.DISTRESS, colours)
        return np.where(tick.alive, colours, palette.DEAD)

    def _hearing(self, ticks: Sequence[Tick]) -> Iterator[Sheet]:
        # As bits: 5 kB for 200 agents, where pairs of numbers take 20.
        series = [np.packbits(_hears(tick)) for tick in ticks]
        rows = self._heard.changes(series)
        if rows and len(series[0]):
            bits = np.concatenate([series[row] for row in rows])
            counts = [len(series[0])] * len(rows)
            yield Sheet(layout.HEARD, rows, [_column(layout.HEARS, bits, counts)])

    def _missions(self, ticks: Sequence[Tick]) -> Iterator[Sheet]:
        series = [tick.mission for tick in ticks]
        rows = self._flown.changes(series)
        if rows:
            keys = np.concatenate([series[row] for row in rows])
            counts = [len(series[0])] * len(rows)
            yield Sheet(layout.MISSIONS, rows, [_column(layout.MISSION, keys, counts)])

    def _lines(self, ticks: Sequence[Tick]) -> Iterator[Sheet]:
        rows, strips = [], []
        for row, tick in enumerate(ticks):
            if self._drawn.due(tick.index):
                rows.append(row)
                strips.append(lines(tick))
                self._drawn.drawn(tick.index, len(strips[-1]))
        if rows:
            columns = rr.LineStrips3D.columns(strips=np.concatenate(strips))
            yield Sheet(layout.LINKS, rows, columns.partition([len(some) for some in strips]))

    def _packets(self, ticks: Sequence[Tick]) -> Iterator[Sheet]:
        for cause in dict.fromkeys(cause for tick in ticks for cause in tick.packets):
            # What was not told yet is no zero: I8 is not looked at before the first counters.
            told = [row for row, tick in enumerate(ticks) if cause in tick.packets]
            counts = [np.array(ticks[row].packets[cause]) for row in told]
            changes = self._counters.setdefault(cause, Latest()).changes(counts)
            if changes:
                rows, values = [told[at] for at in changes], [float(counts[at]) for at in changes]
                yield Sheet(f"{layout.PACKETS}/{cause}", rows, rr.Scalars.columns(scalars=values))

    def _references(self, last: int) -> Iterator[Sheet]:
        """Return the reference lines, drawn on as far as the block goes."""
        rows = sorted({0, last})
        for metric, values in self._limits.items():
            columns = rr.Scalars.columns(scalars=values * len(rows))
            yield Sheet(layout.limit_of(metric), rows, columns.partition([len(values)] * len(rows)))


def lines(tick: Tick) -> NDArray[np.float32]:
    """Return a line for each pair of which one hears the other (K, 2, 3) [m; world frame].

    Each pair once; of too many, the shortest.
    """
    hears = _hears(tick)
    pairs = np.argwhere(np.triu(hears | hears.T, k=1))
    ends: Singles = tick.position[pairs]
    ends = ends[~np.isnan(ends).any(axis=(1, 2))]
    if len(ends) > LINES_MAX:
        length = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
        ends = ends[np.sort(np.argsort(length, kind="stable")[:LINES_MAX])]
    return ends


def _trail(ticks: Sequence[Tick], colours: palette.Colours) -> Sheet:
    """Return positions with their colours: of a range of time, a viewer shows each as it was."""
    position = np.concatenate([tick.position for tick in ticks])
    columns = rr.Points3D.columns(positions=position, colors=colours)
    counts = [len(ticks[0].alive)] * len(ticks)
    return Sheet(layout.AGENTS, range(len(ticks)), columns.partition(counts))


def _poses(ticks: Sequence[Tick]) -> Iterator[Sheet]:
    rows, counts = range(len(ticks)), [len(ticks[0].alive)] * len(ticks)
    position = np.concatenate([tick.position for tick in ticks])
    attitude = _quaternions(np.concatenate([tick.attitude for tick in ticks]))
    target = np.concatenate([tick.target for tick in ticks])
    boxes = rr.Boxes3D.columns(centers=position, quaternions=attitude)
    yield Sheet(layout.VEHICLES, rows, boxes.partition(counts))
    yield Sheet(layout.TARGETS, rows, rr.Points3D.columns(positions=target).partition(counts))


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
    )


def _metrics(ticks: Sequence[Tick], figures: Sequence[Figures]) -> Iterator[Sheet]:
    counts = [len(ticks[0].alive)] * len(ticks)
    for entity, series in (
        (layout.FORCE, [tick.force for tick in ticks]),
        (layout.TURN_DEG, [tick.turn_deg for tick in ticks]),
        (layout.SEPARATION, [seen.separation for seen in figures]),
        (layout.SLOT_ERROR, [_finite(seen.slot_error) for seen in figures]),
    ):
        columns = rr.Scalars.columns(scalars=np.concatenate(series)).partition(counts)
        yield Sheet(entity, range(len(ticks)), columns)
    near = [seen.obstacle_distance for seen in figures if seen.obstacle_distance is not None]
    if near:
        columns = rr.Scalars.columns(scalars=np.concatenate(near)).partition(counts)
        yield Sheet(layout.OBSTACLE_DISTANCE, range(len(ticks)), columns)


def _state(ticks: Sequence[Tick]) -> Sheet:
    """Return what the judge or a reader needs and no view shows."""
    agents = len(ticks[0].alive)
    place = np.concatenate([tick.place.ravel() for tick in ticks])
    alive = np.concatenate([tick.alive for tick in ticks]).astype(np.uint8)
    attitude = np.concatenate([tick.attitude.ravel() for tick in ticks])
    counts = [agents] * len(ticks)
    columns = [
        _column(layout.PLACE, place, [2 * agents] * len(ticks)),
        _column(layout.ALIVE, alive, counts),
        _column(layout.ATTITUDE, attitude, [3 * agents] * len(ticks)),
    ]
    return Sheet(layout.STATE, range(len(ticks)), columns)


def _column(name: str, values: NDArray[Any], counts: list[int]) -> rr.ComponentColumn:
    """Return numbers of our own kind as a column, ``counts`` of them to a row.

    Given as an Arrow array: rerun looks at anything else number by number.
    """
    return rr.ComponentColumn(name, rr.AnyBatchValue(name, arrow_array(values)), lengths=counts)


def _finite(error: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.where(np.isfinite(error), error, np.nan)


def _hears(tick: Tick) -> NDArray[np.bool_]:
    """Return who hears whom (N, N), of agents that exist: what an agent tells may be anything."""
    agents = len(tick.alive)
    links = tick.links[np.all((tick.links >= 0) & (tick.links < agents), axis=1)]
    hears = np.zeros((agents, agents), dtype=np.bool_)
    hears[links[:, 0], links[:, 1]] = True
    return hears
