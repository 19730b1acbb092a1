"""The components that the recorder sends in blocks, as columns made straight from numbers.

Rerun's own constructors convert and check every column anew, which costs as much as to send it.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
import rerun as rr
from numpy.typing import NDArray
from pyarrow.lib import Array, FixedSizeListArray, FixedSizeListType, ListArray, py_buffer, string
from pyarrow.lib import array as arrow_array

Offsets = NDArray[np.int32]


class ArrowColumn(rr.ComponentColumn):
    """A column of one component whose rows are at hand as an Arrow array of lists."""

    def __init__(self, descriptor: rr.ComponentDescriptor, rows: ListArray) -> None:
        super().__init__(descriptor, _NOTHING, offsets=_NO_OFFSETS)
        self._rows = rows

    def as_arrow_array(self) -> ListArray:
        """Return the rows."""
        return self._rows


class NumberType:
    """A component whose instances are numbers, or vectors of them; example: columns of it."""

    def __init__(self, example: rr.ComponentColumnList) -> None:
        (column,) = example
        self._descriptor = column.component_descriptor()
        instances = column.as_arrow_array().type.value_type
        self._vector = instances if isinstance(instances, FixedSizeListType) else None
        number = instances.value_type if self._vector else instances
        self._dtype = np.dtype(number.to_pandas_dtype())

    def rows(self, values: NDArray[Any]) -> rr.ComponentColumn:
        """Return a row for each batch: numbers (T, N), or vectors (T, N, W)."""
        rows, batch = values.shape[:2]
        return self._column(values, np.arange(rows + 1, dtype=np.int32) * np.int32(batch))

    def parts(self, values: NDArray[Any], lengths: Sequence[int]) -> rr.ComponentColumn:
        """Return a row for each length, with so many of the numbers (K,) or vectors (K, W)."""
        return self._column(values, _offsets(lengths))

    def instances(self, values: NDArray[Any]) -> Array:
        """Return numbers (...) or vectors (..., W) as an Arrow array of instances."""
        flat = arrow_array(np.ascontiguousarray(values, dtype=self._dtype).ravel())
        if self._vector is None:
            return flat
        return FixedSizeListArray.from_arrays(flat, type=self._vector)

    def _column(self, values: NDArray[Any], offsets: Offsets) -> rr.ComponentColumn:
        return ArrowColumn(
            self._descriptor, ListArray.from_arrays(arrow_array(offsets), self.instances(values))
        )


class StripType:
    """A component whose instances are lines of several points each; example: columns of it."""

    def __init__(self, example: rr.ComponentColumnList, points: NumberType) -> None:
        (column,) = example
        self._descriptor = column.component_descriptor()
        self._strip = column.as_arrow_array().type.value_type
        self._points = points

    def parts(self, lines: NDArray[Any], lengths: Sequence[int]) -> rr.ComponentColumn:
        """Return a row for each length, with so many of the lines of P points (K, P, 3)."""
        starts = np.arange(len(lines) + 1, dtype=np.int32) * np.int32(lines.shape[1])
        strips = ListArray.from_arrays(
            arrow_array(starts), self._points.instances(lines), type=self._strip
        )
        rows = ListArray.from_arrays(arrow_array(_offsets(lengths)), strips)
        return ArrowColumn(self._descriptor, rows)


class TextType:
    """A component whose instances are texts; example: columns of it."""

    def __init__(self, example: rr.ComponentColumnList) -> None:
        (column,) = example
        self._descriptor = column.component_descriptor()
        self._text = column.as_arrow_array().type.value_type

    def rows(self, texts: Sequence[str], batch: int = 1) -> rr.ComponentColumn:
        """Return a row for each ``batch`` of texts."""
        offsets = np.arange(0, len(texts) + 1, batch, dtype=np.int32)
        values = arrow_array(texts, type=self._text)
        return ArrowColumn(self._descriptor, ListArray.from_arrays(arrow_array(offsets), values))


def number_column(component: str, rows: NDArray[Any]) -> rr.ComponentColumn:
    """Return a component of qswarm's own as a column: numbers (T, ...), one row for each tick."""
    offsets = np.arange(len(rows) + 1, dtype=np.int32) * np.int32(rows[0].size)
    numbers = ListArray.from_arrays(arrow_array(offsets), arrow_array(rows.ravel()))
    return ArrowColumn(rr.ComponentDescriptor(component), numbers)


def text_column(component: str, texts: Sequence[str]) -> rr.ComponentColumn:
    """Return a component of qswarm's own as a column: a text in each row."""
    offsets = np.arange(len(texts) + 1, dtype=np.int32)
    rows = ListArray.from_arrays(arrow_array(offsets), arrow_array(texts, type=string()))
    return ArrowColumn(rr.ComponentDescriptor(component), rows)


def spread(column: rr.ComponentColumn, at: NDArray[np.intp], rows: int) -> rr.ComponentColumn:
    """Return a column with its rows at some of more rows, and none (null) at the others.

    A null leaves what was shown before; an empty row would replace it.
    """
    filled = column.as_arrow_array()
    lengths, valid = np.zeros(rows, dtype=np.int32), np.zeros(rows, dtype=np.bool_)
    lengths[at], valid[at] = np.diff(filled.offsets.to_numpy()), True
    # From buffers: with a mask, the constructor of lists imports all of Arrow's computing.
    bits = py_buffer(np.packbits(valid, bitorder="little"))
    sparse = ListArray.from_buffers(
        filled.type, rows, [bits, py_buffer(_offsets(lengths))], children=[filled.values]
    )
    return ArrowColumn(column.component_descriptor(), sparse)


def _offsets(lengths: Sequence[int] | Offsets) -> Offsets:
    offsets = np.zeros(len(lengths) + 1, dtype=np.int32)
    np.cumsum(lengths, out=offsets[1:])
    return offsets


_NO_OFFSETS = np.zeros(1, dtype=np.int32)
_NOTHING = rr.AnyBatchValue("nothing", arrow_array([0.0]))
"""What rerun's columns are made of, which have rows of their own here."""
_POINT = np.zeros((1, 3))
_COLOUR = np.zeros(1, dtype=np.uint32)

SCALARS = NumberType(rr.Scalars.columns(scalars=np.zeros(1)))
POINTS = NumberType(rr.Points3D.columns(positions=_POINT))
POINT_COLOURS = NumberType(rr.Points3D.columns(colors=_COLOUR))
BOX_CENTRES = NumberType(rr.Boxes3D.columns(centers=_POINT))
BOX_HALF_SIZES = NumberType(rr.Boxes3D.columns(half_sizes=_POINT))
BOX_QUATERNIONS = NumberType(rr.Boxes3D.columns(quaternions=np.zeros((1, 4))))
BOX_COLOURS = NumberType(rr.Boxes3D.columns(colors=_COLOUR))
ARROW_ORIGINS = NumberType(rr.Arrows3D.columns(origins=_POINT))
ARROW_VECTORS = NumberType(rr.Arrows3D.columns(vectors=_POINT))
STRIPS = StripType(rr.LineStrips3D.columns(strips=[[(0.0, 0.0, 0.0)] * 2]), POINTS)
STRIP_COLOURS = NumberType(rr.LineStrips3D.columns(colors=_COLOUR))
TRANSLATIONS = NumberType(rr.Transform3D.columns(translation=_POINT))
SCALES = NumberType(rr.Transform3D.columns(scale=_POINT))

BOX_LABELS = TextType(rr.Boxes3D.columns(labels=[""]))
STATES = TextType(rr.StateChange.columns(state=[""]))
LOG_TEXTS = TextType(rr.TextLog.columns(text=[""]))
LOG_LEVELS = TextType(rr.TextLog.columns(level=[""]))
