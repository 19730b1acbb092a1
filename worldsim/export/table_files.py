"""Tables as files: Parquet and CSV, one file for each table.

Parquet holds unit, frame and meaning of each column as metadata of its field. CSV cannot, so the
file ``columns.csv`` beside the tables holds them.
"""

from collections.abc import Iterable
from pathlib import Path

import pyarrow as pa
from pyarrow import csv, parquet

from worldsim.results.table import Table

COLUMNS = "columns.csv"


def write_parquet(tables: Iterable[Table], folder: Path) -> None:
    """Write each table as NAME.parquet. Raises OSError."""
    for table in tables:
        parquet.write_table(table.arrow(), folder / f"{table.name}.parquet")


def write_csv(tables: Iterable[Table], folder: Path) -> None:
    """Write each table as NAME.csv, NaN as an empty field, and what their columns hold.

    Raises OSError.
    """
    described = []
    for table in tables:
        csv.write_csv(_with_gaps(table), folder / f"{table.name}.csv")
        described += [{"table": table.name, **column._asdict()} for column in table.layout.columns]
    csv.write_csv(pa.Table.from_pylist(described), folder / COLUMNS)


def _with_gaps(table: Table) -> pa.Table:
    """Return a table with nothing where there is NaN: readers differ in how they write it."""
    arrow = table.arrow()
    arrays = [pa.array(table[field.name], field.type, from_pandas=True) for field in arrow.schema]
    return pa.Table.from_arrays(arrays, schema=arrow.schema)
