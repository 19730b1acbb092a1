"""A table of a run: named columns of equal length, each with a unit, a frame and a meaning."""

from collections.abc import Iterator, Mapping, Sequence
from importlib import import_module
from typing import Any, Literal, NamedTuple

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

Kind = Literal["number", "integer", "flag", "text"]
DTYPES: dict[Kind, Any] = {
    "number": np.float64,
    "integer": np.int64,
    "flag": np.bool_,
    "text": np.object_,
}
ARROW_TYPES: dict[Kind, Any] = {
    "number": pa.float64(),
    "integer": pa.int64(),
    "flag": pa.bool_(),
    "text": pa.string(),
}


class Column(NamedTuple):
    """What a column of a table holds."""

    name: str
    kind: Kind
    unit: str  # "" for none
    frame: str  # "" for what is not in a frame
    says: str


class Layout(NamedTuple):
    """What a table holds: one row for what, and its columns."""

    says: str
    columns: tuple[Column, ...]


class Table(Mapping[str, NDArray[Any]]):
    """A table as a mapping from the name of a column to its values (R,).

    Numbers are float64, integers int64, flags bool, and texts objects of type str. NaN stands for a
    number that was not measured. Raises ValueError where the values do not fit the layout.
    """

    def __init__(self, name: str, layout: Layout, values: Sequence[Any]) -> None:
        self.name = name
        self.layout = layout
        self._values = {
            column.name: np.asarray(each, dtype=DTYPES[column.kind])
            for column, each in zip(layout.columns, values, strict=True)
        }
        if len({len(each) for each in self._values.values()}) > 1:
            raise ValueError(f"{name}: the columns differ in length")

    def __getitem__(self, column: str) -> NDArray[Any]:
        return self._values[column]

    def __iter__(self) -> Iterator[str]:
        return iter(self._values)

    def __len__(self) -> int:
        return len(self._values)

    def __repr__(self) -> str:
        return f"<{self.name}: {self.rows} rows of {', '.join(self)}>"

    @property
    def rows(self) -> int:
        """The number of rows."""
        return len(next(iter(self._values.values())))

    def numpy(self) -> NDArray[Any]:
        """Return the table as one structured array (R,), with a field for each column."""
        types = [(column.name, DTYPES[column.kind]) for column in self.layout.columns]
        array = np.empty(self.rows, dtype=types)
        for name, values in self.items():
            array[name] = values
        return array

    def arrow(self) -> pa.Table:
        """Return the table for pyarrow; unit, frame and meaning are the fields' metadata."""
        fields = [
            pa.field(column.name, ARROW_TYPES[column.kind], metadata=_metadata(column))
            for column in self.layout.columns
        ]
        arrays = [
            pa.array(self[field.name], type=field.type, from_pandas=False) for field in fields
        ]
        return pa.Table.from_arrays(arrays, schema=pa.schema(fields))

    def pandas(self) -> Any:
        """Return the table as a pandas.DataFrame. Raises ModuleNotFoundError without pandas."""
        return import_module("pandas").DataFrame(dict(self))

    def polars(self) -> Any:
        """Return the table as a polars.DataFrame. Raises ModuleNotFoundError without polars."""
        return import_module("polars").from_arrow(self.arrow())


def _metadata(column: Column) -> dict[str, str]:
    known = {"unit": column.unit, "frame": column.frame, "description": column.says}
    return {key: text for key, text in known.items() if text}
