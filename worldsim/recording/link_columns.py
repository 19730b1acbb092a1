"""Radio links as columns: the whole matrix for readers, and a line for each pair for the viewer.

The matrix has a row where it changed. Lines are drawn at as many ticks as their rate limit allows.
"""

from collections.abc import Iterator, Sequence

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from worldsim.judge.tick import Tick
from worldsim.recording import layout
from worldsim.recording.columns import (
    ChangeDetector,
    ColumnBlock,
    LineRateLimiter,
    line_strips,
    number_column,
)
from worldsim.truth.vehicle import Floats

LINES_MAX = 400
LINES_PER_S = 2000
"""More lines at once, or in a second, would cost more than everything else in the recording."""

PairCodes = NDArray[np.int64]
"""Pairs (hearer, heard) of N agents, each coded as hearer * N + heard."""


class LinkColumns:
    """Makes the columns of one block of ticks after the other; tick_hz: ticks in a second."""

    def __init__(self, tick_hz: float) -> None:
        self._matrix_changes = ChangeDetector()
        self._line_rate = LineRateLimiter(tick_hz, LINES_PER_S)

    def blocks(self, ticks: Sequence[Tick]) -> Iterator[ColumnBlock]:
        """Yield the columns of a block; blocks come in order."""
        yield from self._matrix(ticks)
        yield from self._lines(ticks)

    def _matrix(self, ticks: Sequence[Tick]) -> Iterator[ColumnBlock]:
        hears = np.zeros((len(ticks), len(ticks[0].alive) ** 2), dtype=np.bool_)
        for row, tick in zip(hears, ticks, strict=True):
            row[_pair_codes(tick)] = True
        # As bits: 5 kB for 200 agents, where pairs of numbers take 20.
        bits = np.packbits(hears, axis=1)
        rows = self._matrix_changes.changed_rows(bits)
        if rows:
            yield ColumnBlock(layout.LINK_STATE, rows, [number_column(layout.HEARS, bits[rows])])

    def _lines(self, ticks: Sequence[Tick]) -> Iterator[ColumnBlock]:
        rows, drawn = [], []
        for row, tick in enumerate(ticks):
            if self._line_rate.allows(tick.index):
                rows.append(row)
                drawn.append(link_lines(tick))
                self._line_rate.count(tick.index, len(drawn[-1]))
        if rows:
            columns = rr.LineStrips3D.columns(strips=line_strips(np.concatenate(drawn)))
            lengths = [len(lines) for lines in drawn]
            yield ColumnBlock(layout.LINKS, rows, columns.partition(lengths))


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
