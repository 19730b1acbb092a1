"""Who hears whom, as sheets: for a reader the whole matrix, for a viewer a line for each pair.

The matrix has a row where it changed; lines are drawn anew as often as they are not too many.
"""

from collections.abc import Iterator, Sequence

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from worldsim.judge.tick import Singles, Tick
from worldsim.recording import layout
from worldsim.recording.columns import ColumnBlock, Latest, Thinned, numbers, strips_of

LINES_MAX = 400
LINES_PER_S = 2000
"""More lines than these at once, or in a second, would cost more than all the rest together."""

Codes = NDArray[np.int64]
"""Pairs of N agents, each as one number: the first times N, and the second."""


class HearingSheets:
    """Makes the sheets of one block of ticks after the other; tick_hz: ticks in a second."""

    def __init__(self, tick_hz: float) -> None:
        self._heard = Latest()
        self._drawn = Thinned(tick_hz, LINES_PER_S)

    def of(self, ticks: Sequence[Tick]) -> Iterator[ColumnBlock]:
        """Return the sheets of a block; blocks come in order."""
        yield from self._matrix(ticks)
        yield from self._lines(ticks)

    def _matrix(self, ticks: Sequence[Tick]) -> Iterator[ColumnBlock]:
        hears = np.zeros((len(ticks), len(ticks[0].alive) ** 2), dtype=np.bool_)
        for row, tick in zip(hears, ticks, strict=True):
            row[_heard(tick)] = True
        # As bits: 5 kB for 200 agents, where pairs of numbers take 20.
        bits = np.packbits(hears, axis=1)
        rows = self._heard.changes(bits)
        if rows:
            yield ColumnBlock(layout.HEARD, rows, [numbers(layout.HEARS, bits[rows])])

    def _lines(self, ticks: Sequence[Tick]) -> Iterator[ColumnBlock]:
        rows, drawn = [], []
        for row, tick in enumerate(ticks):
            if self._drawn.due(tick.index):
                rows.append(row)
                drawn.append(lines(tick))
                self._drawn.drawn(tick.index, len(drawn[-1]))
        if rows:
            columns = rr.LineStrips3D.columns(strips=strips_of(np.concatenate(drawn)))
            yield ColumnBlock(layout.LINKS, rows, columns.partition([len(some) for some in drawn]))


def lines(tick: Tick) -> Singles:
    """Return a line for each pair of which one hears the other (K, 2, 3) [m; world frame].

    Each pair once; of too many, the shortest.
    """
    agents = len(tick.alive)
    hearer, heard = np.divmod(_heard(tick), agents)
    low, high = np.minimum(hearer, heard), np.maximum(hearer, heard)
    once = np.unique((low * agents + high)[low < high])
    ends: Singles = tick.position[np.stack(np.divmod(once, agents), axis=1)]
    length = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    if len(ends) > LINES_MAX:
        shortest = np.sort(np.argsort(length, kind="stable")[:LINES_MAX])
        ends, length = ends[shortest], length[shortest]
    there: Singles = ends[np.isfinite(length)]
    return there


def _heard(tick: Tick) -> Codes:
    """Return hearer and heard, of agents that exist: what an agent tells may be anything."""
    agents = len(tick.alive)
    hearer, heard = tick.links.T.astype(np.int64)
    exist = (hearer >= 0) & (hearer < agents) & (heard >= 0) & (heard < agents)
    codes: Codes = (hearer * agents + heard)[exist]
    return codes
