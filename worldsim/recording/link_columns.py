"""Radio links as columns: the whole matrix for readers, and a line for each pair for the viewer.

The matrix has a row where it changed. Lines are drawn at as many ticks as their rate limit allows.
"""

from collections.abc import Generator, Iterator, Mapping, Sequence

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

Missing = dict[str, Floats]
"""Lines (K, 2, 3) [m; world frame] by entity."""
PairCodes = NDArray[np.int64]
"""Pairs (hearer, heard) of N agents, each coded as hearer * N + heard."""


class LinkColumns:
    """Makes the columns of one block of ticks after the other; tick_hz: ticks in a second."""

    def __init__(self, tick_hz: float) -> None:
        self._matrix_changes = ChangeDetector()
        self._missed: dict[str, int] = {}
        """How many lines each entity of missing links shows."""
        self._tick_hz = tick_hz
        self._sought_in: Situation | None = None
        self._sought_at = 0
        """Where missing links were last looked for."""
        self._line_rate = LineRateLimiter(tick_hz, LINES_PER_S)

    def blocks(
        self, ticks: Sequence[Tick], situations: Sequence[Situation]
    ) -> Iterator[ColumnBlock]:
        """Yield the columns of a block; blocks come in order."""
        yield from self._matrix(ticks)
        heard = yield from self._lines(ticks)
        yield from self._verdicts(ticks, situations, heard)

    def _matrix(self, ticks: Sequence[Tick]) -> Iterator[ColumnBlock]:
        hears = np.zeros((len(ticks), len(ticks[0].alive) ** 2), dtype=np.bool_)
        for row, tick in zip(hears, ticks, strict=True):
            row[_pair_codes(tick)] = True
        # As bits: 5 kB for 200 agents, where pairs of numbers take 20.
        bits = np.packbits(hears, axis=1)
        rows = self._matrix_changes.changed_rows(bits)
        if rows:
            yield ColumnBlock(layout.LINK_STATE, rows, [number_column(layout.HEARS, bits[rows])])

    def _lines(self, ticks: Sequence[Tick]) -> Generator[ColumnBlock, None, dict[int, int]]:
        """Yield the lines of links; return how many are drawn in which rows."""
        rows, drawn = [], []
        for row, tick in enumerate(ticks):
            if self._line_rate.allows(tick.index):
                rows.append(row)
                drawn.append(link_lines(tick))
                self._line_rate.count(tick.index, len(drawn[-1]))
        if rows:
            yield _strips(layout.LINKS, rows, drawn)
        return dict(zip(rows, map(len, drawn), strict=True))

    def _verdicts(
        self,
        ticks: Sequence[Tick],
        situations: Sequence[Situation],
        heard: Mapping[int, int],
    ) -> Iterator[ColumnBlock]:
        """Yield the pairs that do not hear each other, by the reason, where there are any.

        They are looked for where the situation changes, and else rarely. heard: how many pairs hear
        each other, in which rows.
        """
        rows = [row for row in heard if self._is_due(ticks[row], situations[row])]
        missing = [missing_links(ticks[row], situations[row]) for row in rows]
        yield from self._counts(rows, [heard[row] for row in rows], missing)
        for entity in (layout.LINKS_LOST, layout.LINKS_CUT, layout.LINKS_OUT_OF_RANGE):
            drawn = [each[entity] for each in missing]
            # While there are none, nothing is repeated.
            before = [self._missed.get(entity, 0), *map(len, drawn)]
            some = [at for at in range(len(drawn)) if before[at] or before[at + 1]]
            self._missed[entity] = before[-1]
            if some:
                yield _strips(entity, [rows[at] for at in some], [drawn[at] for at in some])

    def _is_due(self, tick: Tick, situation: Situation) -> bool:
        """Return whether missing links are to be found at a tick."""
        every_s = MISSING_EVERY_S[len(tick.alive) > layout.NAMED_MAX]
        next_at = self._sought_at + round(self._tick_hz * every_s)
        if situation is self._sought_in and tick.index < next_at:
            return False
        self._sought_in, self._sought_at = situation, tick.index
        return True

    def _counts(
        self, rows: Sequence[int], heard: Sequence[int], missing: Sequence[Missing]
    ) -> Iterator[ColumnBlock]:
        """Yield how many pairs have a link, and how many are missing, by the reason."""
        if rows:
            counts = [
                [linked, *(len(lines) for lines in each.values())]
                for linked, each in zip(heard, missing, strict=True)
            ]
            yield ColumnBlock(layout.LINK_COUNTS, rows, [SCALARS.rows(np.array(counts))])


def missing_links(tick: Tick, situation: Situation) -> Missing:
    """Return a line (K, 2, 3) [m; world frame] for each pair that does not hear each other.

    By entity. A pair of running agents is cut where a fault cuts a direction in which it is not
    heard, else lost where such a direction is within its range, else out of range. Of more than
    LINES_MAX, the shortest are kept; of large fleets, none out of range.
    """
    agents = len(tick.alive)
    heard = np.zeros((agents, agents), dtype=np.bool_)  # from row to column
    hearer, source = np.divmod(_pair_codes(tick), agents)
    heard[source, hearer] = True
    unheard = ~heard & tick.alive[:, None] & tick.alive
    np.fill_diagonal(unheard, val=False)
    one, other = np.nonzero(np.triu(unheard | unheard.T))
    distance = np.full((agents, agents), np.nan)
    away = np.linalg.norm(tick.position[one] - tick.position[other], axis=1)
    distance[one, other] = distance[other, one] = away
    near = situation.radio.in_range(distance) & unheard
    cut = near & situation.radio.cut(tick)
    found = {}
    for entity, links in (
        (layout.LINKS_CUT, cut),
        (layout.LINKS_LOST, near & ~(cut | cut.T)),
        (layout.LINKS_OUT_OF_RANGE, unheard & ~(near | near.T)),
    ):
        pairs = np.argwhere(np.triu(links | links.T))
        if entity == layout.LINKS_OUT_OF_RANGE and agents > layout.NAMED_MAX:
            pairs = pairs[:0]
        found[entity] = _shortest(tick.position[pairs])
    return found


def _strips(entity: str, rows: Sequence[int], drawn: Sequence[Floats]) -> ColumnBlock:
    lengths = [len(lines) for lines in drawn]
    return ColumnBlock(entity, rows, [STRIPS.parts(np.concatenate(drawn), lengths)])


def link_lines(tick: Tick) -> Floats:
    """Return a line (K, 2, 3) [m; world frame] for each pair of agents with a link.

    A pair has one line, whether one or both hear the other. Of more than LINES_MAX, the shortest
    are kept.
    """
    agents = len(tick.alive)
    hearer, heard = np.divmod(_pair_codes(tick), agents)
    low, high = np.minimum(hearer, heard), np.maximum(hearer, heard)
    pairs = np.unique((low * agents + high)[low < high])
    ends: Floats = tick.position[np.stack(np.divmod(pairs, agents), axis=1)]
    return _shortest(ends)


def _shortest(ends: Floats) -> Floats:
    """Return the LINES_MAX shortest of lines (K, 2, 3), of those between vehicles in the world."""
    length = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    if len(ends) > LINES_MAX:
        shortest = np.sort(np.argsort(length, kind="stable")[:LINES_MAX])
        ends, length = ends[shortest], length[shortest]
    in_world: Floats = ends[np.isfinite(length)]
    return in_world


def _pair_codes(tick: Tick) -> PairCodes:
    """Return the links between agents that exist; telemetry may name agents that do not."""
    agents = len(tick.alive)
    hearer, heard = tick.links.T.astype(np.int64)
    exist = (hearer >= 0) & (hearer < agents) & (heard >= 0) & (heard < agents)
    codes: PairCodes = (hearer * agents + heard)[exist]
    return codes
