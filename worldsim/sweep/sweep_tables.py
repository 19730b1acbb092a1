"""The tables of a sweep: a row for each flight, and a row for each cell, with the varied keys.

Pure: a plan and its finished flights in, tables out.
"""

from collections.abc import Sequence
from typing import Any

from worldsim.results.table import Column, Kind, Layout, Table
from worldsim.scenario.toml import value_of
from worldsim.sweep.flight_row import FIGURES
from worldsim.sweep.plan import Axis, Plan
from worldsim.sweep.result import CellRow, Rows

NAN = float("nan")
COUNTS = ("flights", "pass", "fail", "inconclusive")
SHARES = (
    Column("pass_share", "number", "", "", "of the flights that pass or fail"),
    Column("pass_share_low", "number", "", "", "lower end of Wilson's 95 % interval"),
    Column("pass_share_high", "number", "", "", "upper end of Wilson's 95 % interval"),
)


def flights_table(plan: Plan, rows: Rows) -> Table:
    """Return the table of flights, cell by cell and seed by seed."""
    ordered = [rows[key] for key in sorted(rows)]
    columns = (
        *(_key_column(axis) for axis in plan.axes),
        Column("seed", "integer", "", "", "of starts and radio"),
        Column("outcome", "text", "", "", "pass, fail or inconclusive"),
        *FIGURES,
        Column("reason", "text", "", "", "of an outcome that is not a pass"),
        Column("trace_sha256", "text", "", "", "hash of poses, commands and verdicts"),
    )
    values: list[Sequence[Any]] = [
        *_key_values(plan, [row["cell"] for row in ordered]),
        [row["seed"] for row in ordered],
        [row["outcome"] for row in ordered],
        *([_number(row["figures"].get(column.name)) for row in ordered] for column in FIGURES),
        [row["reason"] or "" for row in ordered],
        [row["trace_sha256"] or "" for row in ordered],
    ]
    return Table("flights", Layout("one flight", columns), values)


def cells_table(plan: Plan, cells: list[CellRow]) -> Table:
    """Return the table of cells, with the medians of what their flights measured."""
    rows: list[Any] = list(cells)
    columns = (
        *(_key_column(axis) for axis in plan.axes),
        *(Column(name, "integer", "", "", "number of flights") for name in COUNTS),
        *SHARES,
        *(
            column._replace(name=f"median_{column.name}", says=f"median: {column.says}")
            for column in FIGURES
        ),
    )
    values: list[Sequence[Any]] = [
        *_key_values(plan, range(len(cells))),
        *([row[name] for row in rows] for name in COUNTS),
        *([_number(row[column.name]) for row in rows] for column in SHARES),
        *([_number(row["medians"][column.name]) for row in rows] for column in FIGURES),
    ]
    return Table("cells", Layout("one cell", columns), values)


def _key_column(axis: Axis) -> Column:
    return Column(axis.key, _kind(axis), "", "", "a varied key of the scenario")


def _key_values(plan: Plan, cells: Sequence[int]) -> list[list[Any]]:
    """Return the values of each varied key for some cells."""
    grid = plan.cells
    columns: list[list[Any]] = []
    for number, axis in enumerate(plan.axes):
        texts = [grid[cell][number] for cell in cells]
        kind = _kind(axis)
        columns.append(texts if kind == "text" else [value_of(text) for text in texts])
    return columns


def _kind(axis: Axis) -> Kind:
    values = [value_of(text) for text in axis.values]
    if axis.numbers is None:
        return "text"
    return "integer" if all(isinstance(each, int) for each in values) else "number"


def _number(value: float | None) -> float:
    return NAN if value is None else value
