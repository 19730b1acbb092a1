"""Two sweeps compared flight by flight: by cell and by seed, with paired intervals.

A folder of many runs, as `qswarm sim --seeds` makes it, is a sweep with a cell for each scenario.
"""

import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple, TypedDict

from worldsim.results.run_folder import RunDirectoryError
from worldsim.sweep.flight_row import FIGURES, FlightRow, figures_of
from worldsim.sweep.intervals import Interval, Pairs, paired_mean, paired_share
from worldsim.sweep.journal import is_sweep, read_sweep
from worldsim.sweep.plan import Settings

SUMMARY_FILE = "summary.json"
SCENARIO = "scenario"
"""The key that tells the cells of a folder of many runs apart."""


class PairKey(NamedTuple):
    """A flight in either sweep."""

    settings: Settings
    seed: int


class Difference(TypedDict):
    """The second sweep less the first, over the pairs that measured it."""

    first: float  # mean
    second: float
    difference: float
    low: float | None  # 95 % interval; None for fewer than two pairs
    high: float | None
    pairs: int


class CellPair(TypedDict):
    """One cell in both sweeps."""

    settings: dict[str, str]
    pairs: int
    same_traces: int
    pass_share: Difference | None  # of the pairs that pass or fail in both
    figures: dict[str, Difference | None]  # by the names in flight_row.FIGURES


class SweepPair(TypedDict):
    """Two sweeps compared."""

    kind: str
    sweeps: tuple[str, str]
    unpaired: tuple[int, int]  # flights that the other one lacks
    cells: list[CellPair]


Flights = Mapping[PairKey, FlightRow]


def is_many(folder: Path) -> bool:
    """Return whether a folder is one of a sweep or of many runs."""
    return is_sweep(folder) or (folder.is_dir() and next(_runs_in(folder), None) is not None)


def read_flights(folder: Path) -> Flights:
    """Return the flights of a sweep, or of many runs. Raises RunDirectoryError."""
    if not is_sweep(folder):
        return dict(_many_runs(folder))
    plan, _, rows = read_sweep(folder)
    settings = [tuple(plan.settings(cell).items()) for cell in range(len(plan.cells))]
    return {PairKey(settings[key.cell], key.seed): rows[key] for key in sorted(rows)}


def compare_sweeps(folders: tuple[Path, Path], first: Flights, second: Flights) -> SweepPair:
    """Return two sweeps cell by cell. Raises RunDirectoryError where they have no flight in common.

    Two that vary one key at other values have the common values compared.
    """
    common = sorted(first.keys() & second.keys(), key=lambda key: key.seed)
    if not common:
        raise RunDirectoryError(
            folders[1],
            f"has no flight in common with {folders[0]}: no cell of the same values and seed",
        )
    cells = dict.fromkeys(key.settings for key in first if key in second)
    return {
        "kind": "sweeps",
        "sweeps": (str(folders[0]), str(folders[1])),
        "unpaired": (len(first) - len(common), len(second) - len(common)),
        "cells": [
            _cell(
                settings,
                [(first[key], second[key]) for key in common if key.settings == settings],
            )
            for settings in cells
        ],
    }


def _cell(settings: Settings, pairs: list[tuple[FlightRow, FlightRow]]) -> CellPair:
    same = sum(
        one["trace_sha256"] is not None and one["trace_sha256"] == other["trace_sha256"]
        for one, other in pairs
    )
    return {
        "settings": dict(settings),
        "pairs": len(pairs),
        "same_traces": same,
        "pass_share": _shares(pairs),
        "figures": {column.name: _means(column.name, pairs) for column in FIGURES},
    }


def _shares(pairs: list[tuple[FlightRow, FlightRow]]) -> Difference | None:
    judged = [
        (one["outcome"] == "pass", other["outcome"] == "pass")
        for one, other in pairs
        if "inconclusive" not in (one["outcome"], other["outcome"])
    ]
    if not judged:
        return None
    counts = Pairs(*(judged.count(each) for each in _PASSES))
    first, second = counts.both + counts.first, counts.both + counts.second
    return _difference(first / len(judged), second / len(judged), paired_share(counts), len(judged))


_PASSES = ((True, True), (True, False), (False, True), (False, False))
"""In the order of ``Pairs``."""


def _means(name: str, pairs: list[tuple[FlightRow, FlightRow]]) -> Difference | None:
    both = [(one["figures"].get(name), other["figures"].get(name)) for one, other in pairs]
    known = [(one, other) for one, other in both if one is not None and other is not None]
    if not known:
        return None
    first, second = (sum(column) / len(known) for column in zip(*known, strict=True))
    interval = paired_mean([other - one for one, other in known])
    return _difference(first, second, interval, len(known))


def _difference(first: float, second: float, interval: Interval | None, pairs: int) -> Difference:
    return {
        "first": first,
        "second": second,
        "difference": second - first,
        "low": interval.low if interval else None,
        "high": interval.high if interval else None,
        "pairs": pairs,
    }


def _runs_in(folder: Path) -> Iterator[Path]:
    return (file for file in sorted(folder.glob(f"*/{SUMMARY_FILE}")))


def _many_runs(folder: Path) -> Iterator[tuple[PairKey, FlightRow]]:
    for file in _runs_in(folder):
        try:
            summary: dict[str, Any] = json.loads(file.read_text(encoding="utf-8"))
            row: FlightRow = {
                "cell": 0,
                "seed": summary["seed"],
                "outcome": summary["outcome"],
                "reason": summary["reason"],
                "figures": figures_of(summary),
                "trace_sha256": summary["trace_sha256"],
            }
            settings: Settings = ((SCENARIO, summary["scenario"]),)
        except (OSError, ValueError, KeyError, TypeError) as error:
            raise RunDirectoryError(file, "cannot be read as a run's summary") from error
        yield PairKey(settings, row["seed"]), row
