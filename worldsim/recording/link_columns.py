"""Radio links as columns: the whole matrix for readers, and a line for each pair for the viewer.

The matrix has a row where it changed. Lines are drawn at as many ticks as their rate limit allows.
"""

from collections.abc import Generator, Iterator, Mapping, Sequence
from functools import cache

import numpy as np
from numpy.typing import NDArray

from worldsim.judge.tick import Tick
from worldsim.recording import layout
from worldsim.recording.columns import ChangeDetector, ColumnBlock, LineRateLimiter
from worldsim.recording.components import SCALARS, STRIPS, number_column
from worldsim.recording.situation import Situation
from worldsim.truth.vehicle import Floats

LINES_MAX = 400
LINES_PER_S = 2000
"""More lines at once, or in a second, would cost more than everything else in the recording."""

MISSING_EVERY_S = ((layout.FEW_MAX, 0.2), (layout.NAMED_MAX, 0.4))
"""Missing links of up to so many agents are looked for at least so often."""
MISSING_OF_LARGE_S = 5.0
"""The same of more agents, where they are many."""
MOVED_EVERY_S = 1.0
"""Between two looks, their lines move with the vehicles at least so often."""
FAR_EVERY_S = 1.0
"""Links out of range are many, and hidden until asked for: they are drawn less often."""

NO_LINES: Floats = np.zeros((0, 2, 3))
Missing = dict[str, NDArray[np.intp]]
"""Pairs of agents (K, 2) by entity."""
Matrices = NDArray[np.bool_]
"""For each tick, who hears whom (T, N, N)."""


class LinkColumns:
    """Makes the columns of one block of ticks after the other; tick_hz: ticks in a second."""

    def __init__(self, tick_hz: float) -> None:
        self._matrix_changes = ChangeDetector()
        self._missing: Missing = {}
        """The missing links that are shown."""
        self._tick_hz = tick_hz
        self._sought_in: Situation | None = None
        self._sought_at = self._moved_at = self._far_at = 0
        """The ticks at which missing links were last looked for, and last drawn."""
        self._line_rate = LineRateLimiter(tick_hz, LINES_PER_S)
        self._far: dict[int, Floats] = {}
        self._far_before = 0
        """The lines out of range by tick, and how many there were at the last one."""
        self._counted: dict[int, list[int]] = {}
        """Numbers of pairs by tick, which are yet to be sent."""

    def blocks(
        self, ticks: Sequence[Tick], situations: Sequence[Situation]
    ) -> Iterator[ColumnBlock]:
        """Yield the columns of a block; blocks come in order."""
        hears = hears_of(ticks)
        yield from self._matrix(hears)
        heard = yield from self._lines(ticks, hears)
        yield from self._verdicts(ticks, situations, heard, hears)

    def detail(self, ticks: Sequence[Tick]) -> Iterator[ColumnBlock]:
        """Yield how many links there are, and those out of range, of some ticks that were sent."""
        row_of = {tick.index: row for row, tick in enumerate(ticks)}
        if self._counted:
            rows = [row_of[index] for index in self._counted]
            counts = np.array(list(self._counted.values()))
            yield ColumnBlock(layout.LINK_COUNTS, rows, [SCALARS.rows(counts)])
        if self._far:
            rows = [row_of[index] for index in self._far]
            yield _strips(layout.LINKS_OUT_OF_RANGE, rows, list(self._far.values()))
        self._counted, self._far = {}, {}

    def _matrix(self, hears: Matrices) -> Iterator[ColumnBlock]:
        # As bits: 5 kB for 200 agents, where pairs of numbers take 20.
        bits = np.packbits(hears.reshape(len(hears), -1), axis=1)
        rows = self._matrix_changes.changed_rows(bits)
        if rows:
            yield ColumnBlock(layout.AGENT_STATE, rows, [number_column(layout.HEARS, bits[rows])])

    def _lines(
        self, ticks: Sequence[Tick], hears: Matrices
    ) -> Generator[ColumnBlock, None, dict[int, int]]:
        """Yield a line for each pair of which one hears the other; return how many in which rows.

        Of more than LINES_MAX, the shortest are drawn.
        """
        drawn: dict[int, Floats] = {}
        heard_pairs: dict[int, int] = {}
        for row, (tick, heard) in enumerate(zip(ticks, hears, strict=True)):
            if self._line_rate.allows(tick.index):
                linked = _pairs(heard | heard.T)
                drawn[row] = _lines(tick, linked)
                heard_pairs[row] = len(linked)
                self._line_rate.count(tick.index, len(drawn[row]))
        if drawn:
            yield _strips(layout.LINKS, list(drawn), list(drawn.values()))
        return heard_pairs

    def _verdicts(
        self,
        ticks: Sequence[Tick],
        situations: Sequence[Situation],
        heard: Mapping[int, int],
        hears: Matrices,
    ) -> Iterator[ColumnBlock]:
        """Yield the pairs that do not hear each other, by the reason, where there are any.

        They are looked for where the situation changes, and else rarely; in between, their lines
        move with the vehicles. heard: how many pairs hear each other, in which rows.
        """
        shown: dict[int, Missing] = {}
        before = self._missing
        for row, linked in heard.items():
            tick, situation = ticks[row], situations[row]
            is_new, is_due = situation is not self._sought_in, self._is_due(tick, situation)
            if is_due:
                missing = self._missing = missing_links(tick, situation, hears[row])
                self._counted[tick.index] = [linked, *map(len, missing.values())]
            if is_due or self._has_moved(tick):
                shown[row] = self._missing
                self._moved_at = tick.index
            if is_new or tick.index >= self._far_at + round(self._tick_hz * FAR_EVERY_S):
                self._note_far(tick)
        for entity in (layout.LINKS_LOST, layout.LINKS_CUT):
            yield from _moving_lines(entity, ticks, shown, len(before.get(entity, ())))

    def _note_far(self, tick: Tick) -> None:
        """Note the lines of links out of range at a tick, and none once, where they end."""
        self._far_at = tick.index
        lines = _lines(tick, self._missing[layout.LINKS_OUT_OF_RANGE])
        if len(lines) or self._far_before:
            self._far[tick.index] = lines
        self._far_before = len(lines)

    def _has_moved(self, tick: Tick) -> bool:
        return tick.index >= self._moved_at + round(self._tick_hz * MOVED_EVERY_S)

    def _is_due(self, tick: Tick, situation: Situation) -> bool:
        """Return whether missing links are to be found at a tick."""
        agents = len(tick.alive)
        times = (every_s for most, every_s in MISSING_EVERY_S if agents <= most)
        every_s = next(times, MISSING_OF_LARGE_S)
        next_at = self._sought_at + round(self._tick_hz * every_s)
        if situation is self._sought_in and tick.index < next_at:
            return False
        self._sought_in, self._sought_at = situation, tick.index
        return True


def missing_links(tick: Tick, situation: Situation, hears: NDArray[np.bool_]) -> Missing:
    """Return the pairs of agents (K, 2) that do not hear each other.

    By entity. A pair of running agents is cut where a fault cuts a direction in which it is not
    heard, else lost where such a direction is within its range, else out of range. Of large fleets,
    none is out of range. hears: who hears whom (N, N).
    """
    agents = len(tick.alive)
    apart = ~(hears & hears.T) & tick.alive & tick.alive[:, None]
    pairs = _pairs(apart)
    one, other = pairs.T
    along = tick.position[other] - tick.position[one]
    away = np.sqrt(np.einsum("ij,ij->i", along, along))
    near, cuts = np.zeros((2, len(one)), dtype=np.bool_)
    cut = situation.radio.cut(tick) if situation.radio.cuts else None
    for source, hearer in ((one, other), (other, one)):
        unheard = situation.radio.in_range(away, source, hearer)
        unheard &= ~hears[hearer, source]
        near |= unheard
        if cut is not None:
            cuts |= unheard & cut[source, hearer]
    far = ~near if agents <= layout.NAMED_MAX else np.zeros_like(near)
    return {
        layout.LINKS_CUT: pairs[cuts],
        layout.LINKS_LOST: pairs[near & ~cuts],
        layout.LINKS_OUT_OF_RANGE: pairs[far],
    }


def _moving_lines(
    entity: str, ticks: Sequence[Tick], shown: Mapping[int, Missing], before: int
) -> Iterator[ColumnBlock]:
    """Yield the lines of missing links in some rows, and none once, where they end.

    before: how many lines are shown before the first row.
    """
    rows, drawn = [], []
    for row, missing in shown.items():
        lines = _lines(ticks[row], missing[entity])
        if len(lines) or before:
            rows.append(row)
            drawn.append(lines)
        before = len(lines)
    if rows:
        yield _strips(entity, rows, drawn)


def _strips(entity: str, rows: Sequence[int], drawn: Sequence[Floats]) -> ColumnBlock:
    lengths = [len(lines) for lines in drawn]
    return ColumnBlock(entity, rows, [STRIPS.parts(np.concatenate(drawn), lengths)])


def _lines(tick: Tick, pairs: NDArray[np.intp]) -> Floats:
    """Return the lines (K, 2, 3) [m; world frame] of pairs of agents, of those in the world.

    Of more than LINES_MAX, the shortest.
    """
    if not len(pairs):
        return NO_LINES
    ends = tick.position[pairs]
    along = ends[:, 1] - ends[:, 0]
    square = np.einsum("ij,ij->i", along, along)
    if len(ends) > LINES_MAX:
        shortest = np.sort(np.argpartition(square, LINES_MAX)[:LINES_MAX])
        ends, square = ends[shortest], square[shortest]
    in_world: Floats = ends[np.isfinite(square)]
    return in_world


@cache
def _above(agents: int) -> NDArray[np.bool_]:
    """Return which of a matrix (N, N) has a pair of agents, the lower one first."""
    return np.triu(np.ones((agents, agents), dtype=np.bool_), 1)


def _pairs(chosen: NDArray[np.bool_]) -> NDArray[np.intp]:
    """Return the pairs (K, 2) of agents, the lower one first, of a symmetric matrix (N, N)."""
    agents = len(chosen)
    at = np.flatnonzero(chosen & _above(agents))
    return np.stack(np.divmod(at, agents), axis=1)


def hears_of(ticks: Sequence[Tick]) -> Matrices:
    """Return who hears whom (T, N, N), from hearer to heard.

    Telemetry may name agents that do not exist; their links are left out.
    """
    agents = len(ticks[0].alive)
    hears = np.zeros((len(ticks), agents, agents), dtype=np.bool_)
    links = np.concatenate([tick.links for tick in ticks]).astype(np.int64)
    row = np.repeat(np.arange(len(ticks)), [len(tick.links) for tick in ticks])
    if links.size and (links.min() < 0 or links.max() >= agents):
        exist = ((links >= 0) & (links < agents)).all(axis=1)
        row, links = row[exist], links[exist]
    hears.reshape(-1)[(row * agents + links[:, 0]) * agents + links[:, 1]] = True
    return hears
