"""One flight of a sweep as a row: its outcome and its main figures.

Pure. To add a figure: a column in FIGURES, and its value in ``figures_of``.
"""

from collections.abc import Mapping
from typing import Any, TypedDict

from worldsim.campaign.flight_site import Flown
from worldsim.results.outcome import Outcome
from worldsim.results.table import Column
from worldsim.sweep.plan import FlightKey

FIGURES = (
    Column(
        "converge_s", "number", "s", "", "from a formation's start until converged; the slowest"
    ),
    Column("residual_m", "number", "m", "", "largest slot error at the end of a formation"),
    Column("max_slot_error_m", "number", "m", "", "largest slot error after convergence"),
    Column("in_formation_fraction", "number", "", "", "of the time after convergence"),
    Column("min_separation_m", "number", "m", "", "nearest two vehicles, centre to centre"),
    Column("min_obstacle_distance_m", "number", "m", "", "nearest obstacle, centre to surface"),
    Column("turns_over_limit_fraction", "number", "", "", "of moving steps"),
    Column("delivered_fraction", "number", "", "", "of packets, once for each receiver"),
    Column("violations", "number", "", "", "ticks in which an invariant was violated"),
)


class FlightRow(TypedDict):
    """A flight's line in the journal; None for what was not measured."""

    cell: int  # index into Plan.cells
    seed: int
    outcome: Outcome
    reason: str | None  # of an outcome that is not a pass
    figures: dict[str, float | None]  # by the names in FIGURES
    trace_sha256: str | None


def row_of(key: FlightKey, flown: Flown) -> FlightRow:
    """Return a flight's row."""
    summary = flown.summary
    return {
        "cell": key.cell,
        "seed": key.seed,
        "outcome": flown.outcome,
        "reason": flown.reason,
        "figures": figures_of(summary) if summary is not None else {},
        "trace_sha256": summary["trace_sha256"] if summary is not None else None,
    }


def figures_of(summary: Mapping[str, Any]) -> dict[str, float | None]:
    """Return the main figures of a run's summary, by the names in FIGURES."""
    packets, phases = summary["packets"], summary["phases"]
    alike = ("max_slot_error_m", "in_formation_fraction", "turns_over_limit_fraction")
    distances = ("min_separation_m", "min_obstacle_distance_m")
    return {
        "converge_s": _worst([phase["converge_s"] for phase in phases]),
        "residual_m": _worst([phase["residual_m"] for phase in phases]),
        **{name: summary[name] for name in (*alike, *distances)},
        "delivered_fraction": _share(packets["delivered"], packets["addressed"]),
        "violations": sum(tally["violations"] for tally in summary["invariants"].values()),
    }


def _worst(values: list[float | None]) -> float | None:
    """Return the largest value; None where one was not measured."""
    known = [value for value in values if value is not None]
    return max(known) if known and len(known) == len(values) else None


def _share(part: int | None, whole: int | None) -> float | None:
    return part / whole if part is not None and whole else None
