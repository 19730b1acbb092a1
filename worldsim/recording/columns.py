"""What the recorder sends: entities, and blocks of columns with a row for some ticks."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from worldsim.recording.components import spread


class Entity(NamedTuple):
    """What is logged under one entity path at one time, or as static data."""

    path: str
    archetype: rr.AsComponents


@dataclass(frozen=True, slots=True)
class ColumnBlock:
    """Columns of one entity, with a row for some ticks of a block."""

    entity: str
    rows: Sequence[int]  # indices into the block's ticks; empty for columns without a time
    columns: Iterable[rr.ComponentColumn]

    @classmethod
    def of_batches(
        cls, entity: str, rows: Sequence[int], columns: rr.ComponentColumnList, batch: int
    ) -> "ColumnBlock":
        """Return a block in which every row holds ``batch`` instances of each component."""
        return cls(entity, rows, columns.partition([batch] * len(rows)))


def merged(blocks: Iterable[ColumnBlock]) -> list[ColumnBlock]:
    """Return the same columns in as few blocks as can be: each costs much, whatever it holds.

    Blocks of an entity become one where their components differ, with a row where any has one.
    """
    parts: dict[tuple[str, bool, int], list[ColumnBlock]] = {}
    repeats: dict[tuple[str, str], int] = {}
    for block in blocks:
        columns = list(block.columns)
        names = [str(column.component_descriptor()) for column in columns]
        nth = max(repeats.get((block.entity, name), 0) for name in names)
        repeats |= {(block.entity, name): nth + 1 for name in names}
        part = ColumnBlock(block.entity, block.rows, columns)
        parts.setdefault((block.entity, bool(block.rows), nth), []).append(part)
    return [_as_one(some) for some in parts.values()]


def _as_one(blocks: Sequence[ColumnBlock]) -> ColumnBlock:
    """Return blocks of one entity, of different components, as one."""
    if len(blocks) == 1:
        return blocks[0]
    rows = sorted({row for block in blocks for row in block.rows})
    columns: list[rr.ComponentColumn] = []
    for block in blocks:
        if len(block.rows) == len(rows):
            columns.extend(block.columns)
        else:
            at = np.searchsorted(rows, block.rows)
            columns.extend(spread(column, at, len(rows)) for column in block.columns)
    return ColumnBlock(blocks[0].entity, rows, columns)


class ChangeDetector:
    """Finds where a series differs from the row before, across the blocks of a run."""

    def __init__(self) -> None:
        self._last_row: NDArray[Any] | None = None

    def changed_values(self, series: NDArray[Any]) -> NDArray[np.bool_]:
        """Return which values of a series (T, ...) differ from the row before.

        Every value of the run's first row counts as changed.
        """
        changed = np.ones(series.shape, dtype=np.bool_)
        changed[1:] = series[1:] != series[:-1]
        if self._last_row is not None:
            changed[0] = series[0] != self._last_row
        self._last_row = series[-1].copy()
        return changed

    def changed_rows(self, series: NDArray[Any]) -> list[int]:
        """Return the rows of a series (T, ...) in which at least one value changed."""
        changed = self.changed_values(series).reshape(len(series), -1)
        return [int(row) for row in np.flatnonzero(changed.any(axis=1))]


class LineRateLimiter:
    """Limits how many lines are drawn in a second of simulated time."""

    def __init__(self, tick_hz: float, lines_per_s: float) -> None:
        self._ticks_per_line = tick_hz / lines_per_s
        self._next_tick = 0

    def allows(self, tick: int) -> bool:
        """Return whether lines may be drawn at a tick."""
        return tick >= self._next_tick

    def count(self, tick: int, lines: int) -> None:
        """Count the lines drawn at a tick; they delay the next tick that draws any."""
        self._next_tick = tick + max(1, round(lines * self._ticks_per_line))
