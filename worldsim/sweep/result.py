"""What a sweep shows: the share of passes of each cell, and where each number breaks the team.

Pure: a plan and its finished flights in, plain JSON values out.
"""

import statistics
from collections import Counter
from collections.abc import Iterator, Mapping
from itertools import product
from math import isfinite
from typing import NamedTuple, TypedDict

from worldsim.results.provenance import Provenance, provenance
from worldsim.sweep.flight_row import FIGURES, FlightRow
from worldsim.sweep.intervals import wilson
from worldsim.sweep.logistic import Break, Kind, Point, break_of
from worldsim.sweep.plan import FlightKey, Plan

Rows = Mapping[FlightKey, FlightRow]


class CellRow(TypedDict("Outcomes", {"pass": int, "fail": int, "inconclusive": int})):
    """A cell's flights by outcome, and what they measured."""

    settings: dict[str, str]  # of the varied keys
    flights: int
    pass_share: float | None  # of the flights that pass or fail
    pass_share_low: float | None  # Wilson's 95 % interval
    pass_share_high: float | None
    medians: dict[str, float | None]  # of each figure, over the flights that measured it
    measured: dict[str, int]  # number of those flights


class BreakRow(TypedDict):
    """Where a number breaks the team, with the other varied keys held."""

    key: str
    where: dict[str, str]  # the other varied keys
    kind: Kind
    at: float | None
    low: float | None  # None with a break: open on that side
    high: float | None
    falls: bool | None  # whether the share of passes falls as the number grows
    slope: float | None
    text: str


class Summary(Provenance):
    """The content of a sweep's summary.json."""

    schema: int
    mode: str
    scenario: str
    vary: dict[str, list[str]]
    seeds: tuple[int, int]
    runs: int
    outcome: str
    reason: str | None
    cells: list[CellRow]
    breaks: list[BreakRow]


class Line(NamedTuple):
    """The cells along one axis, the others held."""

    axis: int  # index into Plan.axes
    where: dict[str, str]
    cells: tuple[int, ...]  # for each value of the axis


def summary_of(plan: Plan, scenario: str, rows: Rows, cut_off_by: str | None) -> Summary:
    """Return what a sweep shows. cut_off_by: why not every flight was flown; None: every one was.

    The outcome is that of many runs: a failure if one failed.
    """
    cells = cells_of(plan, rows)
    outcomes = {row["outcome"] for row in rows.values()}
    outcomes |= {"inconclusive"} if cut_off_by is not None else set()
    worst = next(bad for bad in ("fail", "inconclusive", "pass") if bad in outcomes)
    return {
        "schema": 1,
        "mode": "virtual",
        "scenario": scenario,
        "vary": {axis.key: list(axis.values) for axis in plan.axes},
        "seeds": (plan.seeds.start, plan.seeds.stop),
        "runs": len(rows),
        "outcome": worst,
        "reason": f"{cut_off_by}: {len(rows)} of {len(plan)} flights done" if cut_off_by else None,
        "cells": cells,
        "breaks": breaks_of(plan, cells),
        **provenance(),
    }


def cells_of(plan: Plan, rows: Rows) -> list[CellRow]:
    """Return a row for each cell, in the plan's order."""
    flown: list[list[FlightRow]] = [[] for _ in plan.cells]
    for key in sorted(rows):
        flown[key.cell].append(rows[key])
    return [_cell(plan.settings(cell), own) for cell, own in enumerate(flown)]


def lines_of(plan: Plan, axis: int) -> Iterator[Line]:
    """Yield the lines of cells along an axis, one for each setting of the other axes."""
    index = {values: number for number, values in enumerate(plan.cells)}
    others = [(each.values if number != axis else ("",)) for number, each in enumerate(plan.axes)]
    for held in product(*others):
        where = {
            each.key: value
            for number, (each, value) in enumerate(zip(plan.axes, held, strict=True))
            if number != axis
        }
        along = plan.axes[axis].values
        cells = (index[(*held[:axis], value, *held[axis + 1 :])] for value in along)
        yield Line(axis, where, tuple(cells))


def breaks_of(plan: Plan, cells: list[CellRow]) -> list[BreakRow]:
    """Return where each varied number breaks the team."""
    return [
        _break_row(plan, line, break_along(plan, line, cells))
        for number, axis in enumerate(plan.axes)
        if axis.numbers is not None and len(axis.values) > 1
        for line in lines_of(plan, number)
    ]


def break_along(plan: Plan, line: Line, cells: list[CellRow]) -> Break:
    """Return where the number of a line's axis breaks the team."""
    numbers = plan.axes[line.axis].numbers or ()
    own = [cells[cell] for cell in line.cells]
    return break_of(
        [
            Point(x, row["pass"], row["pass"] + row["fail"])
            for x, row in zip(numbers, own, strict=True)
        ]
    )


def _cell(settings: dict[str, str], rows: list[FlightRow]) -> CellRow:
    outcomes = Counter(row["outcome"] for row in rows)
    share = wilson(outcomes["pass"], outcomes["pass"] + outcomes["fail"])
    values = {
        column.name: [
            value for row in rows if (value := row["figures"].get(column.name)) is not None
        ]
        for column in FIGURES
    }
    return {
        "settings": settings,
        "flights": len(rows),
        "pass": outcomes["pass"],
        "fail": outcomes["fail"],
        "inconclusive": outcomes["inconclusive"],
        "pass_share": share.value if share else None,
        "pass_share_low": share.low if share else None,
        "pass_share_high": share.high if share else None,
        "medians": {
            name: statistics.median(known) if known else None for name, known in values.items()
        },
        "measured": {name: len(known) for name, known in values.items()},
    }


def _break_row(plan: Plan, line: Line, found: Break) -> BreakRow:
    axis = plan.axes[line.axis]
    return {
        "key": axis.key,
        "where": line.where,
        "kind": found.kind,
        "at": found.at,
        "low": _finite(found.low),
        "high": _finite(found.high),
        "falls": found.falls,
        "slope": found.slope,
        "text": break_text(found, min(axis.numbers or ()), max(axis.numbers or ())),
    }


def break_text(found: Break, least: float, most: float) -> str:
    """Return in words where a number breaks the team. least, most: the tested values."""
    word, tested = "breaks at" if found.falls else "holds from", f"from {least:g} to {most:g}"
    if found.kind == "break":
        return f"{word} {found.at:.3g} (95 %: {_bounds(found)})"
    if found.kind == "separated":
        before, beyond = ("pass", "fail") if found.falls else ("fail", "pass")
        ends = f"{found.low:g} (all {before}) and {found.high:g} (all {beyond})"
        return f"{word} a value between {ends}; no curve fits"
    texts: dict[Kind, str] = {
        "all pass": f"holds {tested}: every flight passes, nothing to fit",
        "all fail": f"fails {tested}: every flight fails, nothing to fit",
        "no trend": f"no trend {tested}",
        "too few": "cannot be fitted: fewer than two of its values were flown",
    }
    return texts.get(found.kind) or _outside_text(found, least, tested)


def _outside_text(found: Break, least: float, tested: str) -> str:
    """Return where the curve reaches one half, outside the tested values."""
    at = found.at or 0.0
    word = "holds" if (at < least) != bool(found.falls) else "fails"
    half = "more" if word == "holds" else "less"
    return f"{word} {tested}: {half} than half pass; the curve reaches one half at {at:.4g}"


def _bounds(found: Break) -> str:
    low, high = _finite(found.low), _finite(found.high)
    if low is not None and high is not None:
        return f"{low:.3g} to {high:.3g}"
    if low is not None:
        return f"from {low:.3g} on, no upper bound in what was flown"
    if high is not None:
        return f"up to {high:.3g}, no lower bound in what was flown"
    return "no bound in what was flown"


def _finite(value: float | None) -> float | None:
    return value if value is not None and isfinite(value) else None
