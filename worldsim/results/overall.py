"""summary.json over many runs: a row for each run, and the spread of each scenario's figures."""

import statistics
from collections import Counter
from collections.abc import Iterable
from pathlib import Path
from typing import NamedTuple, TypedDict, assert_never

from worldsim.results.outcome import Outcome
from worldsim.results.provenance import Provenance, provenance
from worldsim.results.summary import Summary
from worldsim.scenario.tables import Scenario


class Result(NamedTuple):
    """One run that was made."""

    folder: Path
    summary: Summary

    @property
    def outcome(self) -> Outcome:
        """The run's outcome."""
        return self.summary["outcome"]


class FailedRun(NamedTuple):
    """One run that an error ended, a controller's as a rule; it has no summary.

    It is inconclusive where only its summary could not be written, or where it was cut off.
    """

    folder: Path
    scenario: str
    seed: int
    error: str
    details: str = ""  # the traceback, where there is one
    outcome: Outcome = "fail"
    cut_off: bool = False  # whether it was ended because a stop was requested: it shows nothing


Made = Result | FailedRun
"""A run of many."""


def is_cut_off(made: Made, scenario: Scenario) -> bool:
    """Return whether a run ended before its time without an error of its own."""
    if isinstance(made, FailedRun):
        return made.cut_off
    return made.summary["duration_s"] < scenario.duration_s - 1e-6


class Spread(TypedDict):
    """A figure over the runs that measured it."""

    min: float
    median: float
    max: float
    measured: int  # number of runs


class Row(TypedDict):
    """A run's row in the summary over many runs, under the keys of summary.json."""

    run: str  # its folder's name
    scenario: str
    seed: int
    outcome: str
    reason: str | None
    min_separation_m: float | None
    converge_s: float | None  # of several formations the slowest
    residual_m: float | None  # of several formations the largest
    turns_over_limit_fraction: float | None
    sub_formations_lead_s: float | None  # of several formations the shortest
    covers: dict[str, bool]  # whether it showed what some run must show, by the property's name
    real_time_factor: float | None
    trace_sha256: str | None


class ScenarioRow(TypedDict("Outcomes", {"pass": int, "fail": int, "inconclusive": int})):
    """A scenario's row: its runs by outcome, and the spread of each figure."""

    scenario: str
    runs: int
    min_separation_m: Spread | None
    converge_s: Spread | None
    residual_m: Spread | None
    turns_over_limit_fraction: Spread | None
    sub_formations_lead_s: Spread | None
    coverage: dict[str, int]  # in how many runs each property held that some run must show


class Overall(Provenance):
    """The summary over many runs."""

    schema: int
    mode: str
    runs: int
    outcome: str
    reason: str | None
    scenarios: list[ScenarioRow]
    rows: list[Row]


class Cut(NamedTuple):
    """Why not all runs were made that were asked for."""

    by: str
    asked: int
    ended: int = 0  # runs that it ended amid their flight; they have results too

    def text(self, results: int) -> str:
        """Return how many of the runs are done, in words. results: also of those that it ended."""
        ended = f", {self.ended} cut off" if self.ended else ""
        return f"{self.by}: {results - self.ended} of {self.asked} runs done{ended}"


def over_all(results: Iterable[Made], cut: Cut | None = None) -> Overall:
    """Return the summary over many runs: figures by scenario, and a row for each run, as given.

    cut: why not all of the runs that were asked for were made; None: they were.
    """
    rows = [_row(result) for result in results]
    names = list(dict.fromkeys(row["scenario"] for row in rows))
    outcomes = [row["outcome"] for row in rows] + ["inconclusive"] * (cut is not None)
    return {
        "schema": 1,
        "mode": "virtual",
        "runs": len(rows),
        "outcome": next((bad for bad in ("fail", "inconclusive") if bad in outcomes), "pass"),
        "reason": None if cut is None else cut.text(len(rows)),
        "scenarios": [_of_scenario(name, rows) for name in names],
        "rows": rows,
        **provenance(),
    }


def _row(made: Made) -> Row:
    match made:
        case Result():
            return _summary_row(made)
        case FailedRun():
            return _failed_row(made)
    assert_never(made)


def _failed_row(run: FailedRun) -> Row:
    return {
        "run": run.folder.name,
        "scenario": run.scenario,
        "seed": run.seed,
        "outcome": run.outcome,
        "reason": run.error,
        "min_separation_m": None,
        "converge_s": None,
        "residual_m": None,
        "turns_over_limit_fraction": None,
        "sub_formations_lead_s": None,
        "covers": {},
        "real_time_factor": None,
        "trace_sha256": None,
    }


def _summary_row(result: Result) -> Row:
    summary = result.summary
    phases = summary["phases"]
    return {
        "run": result.folder.name,
        "scenario": summary["scenario"],
        "seed": summary["seed"],
        "outcome": summary["outcome"],
        "reason": summary["reason"],
        "min_separation_m": summary["min_separation_m"],
        "converge_s": _worst([phase["converge_s"] for phase in phases]),
        "residual_m": _worst([phase["residual_m"] for phase in phases]),
        "turns_over_limit_fraction": summary["turns_over_limit_fraction"],
        "sub_formations_lead_s": _least([each["lead_s"] for each in summary["sub_formations"]]),
        "covers": {each["name"]: each["first_s"] is not None for each in summary["coverage"]},
        "real_time_factor": summary["real_time_factor"],
        "trace_sha256": summary["trace_sha256"],
    }


def _of_scenario(name: str, rows: list[Row]) -> ScenarioRow:
    own = [row for row in rows if row["scenario"] == name]
    outcomes = Counter(row["outcome"] for row in own)
    return {
        "scenario": name,
        "runs": len(own),
        "pass": outcomes["pass"],
        "fail": outcomes["fail"],
        "inconclusive": outcomes["inconclusive"],
        "min_separation_m": _spread([row["min_separation_m"] for row in own]),
        "converge_s": _spread([row["converge_s"] for row in own]),
        "residual_m": _spread([row["residual_m"] for row in own]),
        "turns_over_limit_fraction": _spread([row["turns_over_limit_fraction"] for row in own]),
        "sub_formations_lead_s": _spread([row["sub_formations_lead_s"] for row in own]),
        "coverage": _coverage([row["covers"] for row in own]),
    }


def _coverage(covers: list[dict[str, bool]]) -> dict[str, int]:
    """Return in how many runs each property held."""
    names = dict.fromkeys(name for each in covers for name in each)
    return {name: sum(each.get(name, False) for each in covers) for name in names}


def _worst(values: list[float | None]) -> float | None:
    known = [value for value in values if value is not None]
    return max(known) if len(known) == len(values) and known else None


def _least(values: list[float | None]) -> float | None:
    return min((value for value in values if value is not None), default=None)


def _spread(values: list[float | None]) -> Spread | None:
    """Return minimum, median and maximum over the runs that measured a value; None: no run did."""
    known = [value for value in values if value is not None]
    if not known:
        return None
    return {
        "min": min(known),
        "median": statistics.median(known),
        "max": max(known),
        "measured": len(known),
    }
