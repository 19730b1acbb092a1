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

MISSING_EVERY_S = (0.2, 5.0)
"""Missing links are looked for at least so often, also in a large fleet, where they are many."""
MOVED_EVERY_S = 1.0
"""Between two looks, their lines move with the vehicles at least so often."""

Missing = dict[str, NDArray[np.intp]]
"""Pairs of agents (K, 2) by entity."""
Matrices = NDArray[np.bool_]
"""For each tick, who hears whom (T, N * N)."""
Pairs = tuple[NDArray[np.intp], NDArray[np.intp]]
"""The lower and the higher agent of each pair."""


class LinkColumns:
    """Makes the columns of one block of ticks after the other; tick_hz: ticks in a second."""

    def __init__(self, tick_hz: float) -> None:
        self._matrix_changes = ChangeDetector()
        self._missing: Missing = {}
        """The missing links that are shown."""
        self._tick_hz = tick_hz
        self._sought_in: Situation | None = None
        self._sought_at = self._moved_at = 0
        """The ticks at which missing links were last looked for, and last drawn."""
        self._line_rate = LineRateLimiter(tick_hz, LINES_PER_S)

    def blocks(
        self, ticks: Sequence[Tick], situations: Sequence[Situation]
    ) -> Iterator[ColumnBlock]:
        """Yield the columns of a block; blocks come in order."""
        hears = _hears(ticks)
        yield from self._matrix(hears)
        heard = yield from self._lines(ticks, hears)
        yield from self._verdicts(ticks, situations, heard)

    def _matrix(self, hears: Matrices) -> Iterator[ColumnBlock]:
        # As bits: 5 kB for 200 agents, where pairs of numbers take 20.
        bits = np.packbits(hears, axis=1)
        rows = self._matrix_changes.changed_rows(bits)
        if rows:
            yield ColumnBlock(layout.LINK_STATE, rows, [number_column(layout.HEARS, bits[rows])])

    def _lines(
        self, ticks: Sequence[Tick], hears: Matrices
    ) -> Generator[ColumnBlock, None, dict[int, int]]:
        """Yield a line for each pair of which one hears the other; return how many in which rows.

        Of more than LINES_MAX, the shortest are drawn.
        """
        agents = len(ticks[0].alive)
        one, other = _pairs(agents)
        there, back = one * agents + other, other * agents + one
        drawn: dict[int, Floats] = {}
        heard_pairs: dict[int, int] = {}
        for row, (tick, heard) in enumerate(zip(ticks, hears, strict=True)):
            if self._line_rate.allows(tick.index):
                linked = np.flatnonzero(heard[there] | heard[back])
                drawn[row] = _lines(tick, np.stack((one[linked], other[linked]), axis=1))
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
    ) -> Iterator[ColumnBlock]:
        """Yield the pairs that do not hear each other, by the reason, where there are any.

        They are looked for where the situation changes, and else rarely; in between, their lines
        move with the vehicles. heard: how many pairs hear each other, in which rows.
        """
        shown: dict[int, Missing] = {}
        sought: dict[int, Missing] = {}
        before = self._missing
        for row in heard:
            if self._is_due(ticks[row], situations[row]):
                sought[row] = self._missing = missing_links(ticks[row], situations[row])
            if row in sought or self._has_moved(ticks[row]):
                shown[row] = self._missing
                self._moved_at = ticks[row].index
        yield from self._counts([heard[row] for row in sought], sought)
        for entity in (layout.LINKS_LOST, layout.LINKS_CUT, layout.LINKS_OUT_OF_RANGE):
            yield from _moving_lines(entity, ticks, shown, len(before.get(entity, ())))

    def _has_moved(self, tick: Tick) -> bool:
        return tick.index >= self._moved_at + round(self._tick_hz * MOVED_EVERY_S)

    def _is_due(self, tick: Tick, situation: Situation) -> bool:
        """Return whether missing links are to be found at a tick."""
        every_s = MISSING_EVERY_S[len(tick.alive) > layout.NAMED_MAX]
        next_at = self._sought_at + round(self._tick_hz * every_s)
        if situation is self._sought_in and tick.index < next_at:
            return False
        self._sought_in, self._sought_at = situation, tick.index
        return True

    def _counts(
        self, heard: Sequence[int], missing: Mapping[int, Missing]
    ) -> Iterator[ColumnBlock]:
        """Yield how many pairs have a link, and how many are missing, by the reason."""
        if missing:
            counts = [
                [linked, *(len(pairs) for pairs in each.values())]
                for linked, each in zip(heard, missing.values(), strict=True)
            ]
            yield ColumnBlock(layout.LINK_COUNTS, list(missing), [SCALARS.rows(np.array(counts))])


def missing_links(tick: Tick, situation: Situation) -> Missing:
    """Return the pairs of agents (K, 2) that do not hear each other.

    By entity. A pair of running agents is cut where a fault cuts a direction in which it is not
    heard, else lost where such a direction is within its range, else out of range. Of large fleets,
    none is out of range.
    """
    agents = len(tick.alive)
    one, other = _pairs(agents)
    hears, cut = _hears([tick])[0], situation.radio.cut(tick)
    apart = tick.alive[one] & tick.alive[other]
    apart &= ~(hears[one * agents + other] & hears[other * agents + one])
    one, other = one[apart], other[apart]
    pairs = np.stack((one, other), axis=1)
    away = np.linalg.norm(tick.position[other] - tick.position[one], axis=1)
    near, cuts = np.zeros((2, len(one)), dtype=np.bool_)
    for source, hearer in ((one, other), (other, one)):
        unheard = ~hears[hearer * agents + source]
        unheard &= situation.radio.in_range(away, source, hearer)
        near |= unheard
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
    ends = tick.position[pairs]
    along = ends[:, 1] - ends[:, 0]
    square = np.einsum("ij,ij->i", along, along)
    if len(ends) > LINES_MAX:
        shortest = np.sort(np.argpartition(square, LINES_MAX)[:LINES_MAX])
        ends, square = ends[shortest], square[shortest]
    in_world: Floats = ends[np.isfinite(square)]
    return in_world


@cache
def _pairs(agents: int) -> Pairs:
    """Return all pairs of agents."""
    return np.triu_indices(agents, 1)


def _hears(ticks: Sequence[Tick]) -> Matrices:
    """Return who hears whom (T, N * N), from hearer to heard, row by row.

    Telemetry may name agents that do not exist; their links are left out.
    """
    agents = len(ticks[0].alive)
    hears = np.zeros((len(ticks), agents * agents), dtype=np.bool_)
    links = np.concatenate([tick.links for tick in ticks])
    row = np.repeat(np.arange(len(ticks)), [len(tick.links) for tick in ticks])
    hearer, heard = links.T.astype(np.int64)
    exist = (hearer >= 0) & (hearer < agents) & (heard >= 0) & (heard < agents)
    hears[row[exist], hearer[exist] * agents + heard[exist]] = True
    return hears
