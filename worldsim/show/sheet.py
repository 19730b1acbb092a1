"""What a block of ticks is sent in: columns of one entity, and what decides which rows it has."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, slots=True)
class Sheet:
    """Columns of one entity; ``rows`` are the ticks of the block that they belong to."""

    entity: str
    rows: Sequence[int]
    columns: Any


class Latest:
    """Remembers a value, and finds where a series departs from the one before."""

    def __init__(self) -> None:
        self._value: NDArray[Any] | None = None

    def changes(self, series: Sequence[NDArray[Any]]) -> list[int]:
        """Return the rows of a series that differ from the row before; the first ever counts."""
        rows = []
        for row, value in enumerate(series):
            if self._value is None or not np.array_equal(self._value, value):
                rows.append(row)
                self._value = value
        return rows


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
