"""What a block of ticks is sent in: columns of one entity, and what decides which rows it has."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import rerun as rr
from numpy.typing import NDArray
from pyarrow.lib import Array, ListArray, field, list_
from pyarrow.lib import array as arrow_array


@dataclass(frozen=True, slots=True)
class ColumnBlock:
    """Columns of one entity; ``rows`` are the ticks of the block that they belong to."""

    entity: str
    rows: Sequence[int]
    columns: Any


class Latest:
    """Remembers a series' last row, and finds where what follows departs from the row before."""

    def __init__(self) -> None:
        self._row: NDArray[Any] | None = None

    def departs(self, series: NDArray[Any]) -> NDArray[np.bool_]:
        """Return which values of a series (T, ...) differ from the row before; the first all do."""
        differs = np.ones(series.shape, dtype=np.bool_)
        differs[1:] = series[1:] != series[:-1]
        if self._row is not None:
            differs[0] = series[0] != self._row
        self._row = series[-1].copy()
        return differs

    def changes(self, series: NDArray[Any]) -> list[int]:
        """Return the rows of a series (T, ...) in which any value departs."""
        differs = self.departs(series).reshape(len(series), -1)
        return [int(row) for row in np.flatnonzero(differs.any(axis=1))]


class Thinned:
    """Decides at which ticks lines are drawn anew, so that they are not too many in a second."""

    def __init__(self, tick_hz: float, lines_per_s: float) -> None:
        self._ticks_per_line = tick_hz / lines_per_s
        self._next = 0

    def due(self, tick: int) -> bool:
        """Whether they are drawn at a tick."""
        return tick >= self._next

    def drawn(self, tick: int, lines: int) -> None:
        """Take how many were drawn at a tick."""
        self._next = tick + max(1, round(lines * self._ticks_per_line))


def numbers(name: str, rows: NDArray[Any]) -> rr.ComponentColumn:
    """Return numbers of our own kind (T, ...) as a column.

    Given as an Arrow array: rerun looks at anything else number by number.
    """
    values = arrow_array(rows.ravel())
    lengths = [rows[0].size] * len(rows)
    return rr.ComponentColumn(name, rr.AnyBatchValue(name, values), lengths=lengths)


def strips_of(lines: NDArray[np.float32]) -> Array:
    """Return lines (K, 2, 3) as rerun keeps strips: given anything else, it looks at each."""
    points = rr.components.Position3DBatch(lines.reshape(-1, 3)).as_arrow_array()
    starts = arrow_array(np.arange(0, len(points) + 1, 2, dtype=np.int32))
    strip = list_(field("item", points.type, nullable=False))
    return ListArray.from_arrays(starts, points, type=strip)
