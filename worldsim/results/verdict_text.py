"""The verdict in words: of one run, of many runs, and of a recording that was judged again."""

from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from worldsim.recording.layout import SUMMARY_FILE
from worldsim.results.overall import Overall, Row, ScenarioRow
from worldsim.results.summary import DeliveryRow, ExpectationRow, Summary

if TYPE_CHECKING:
    from worldsim.recording.verify import Verification

CONVERGE = "converge "
"""An expectation's name begins so where it is about a formation; the formation's name follows."""
MODE_WORDS = {"processes": "processes", "lockstep": "lockstep", "virtual": "virtual time"}
CAUSE_WORDS = {"ahead": "early", "stale": "late", "incarnation": "of a process that was replaced"}
"""Causes of rejection in words; the others are words already."""


def verdict(summary: Summary, folder: Path, recorded: bool) -> str:
    """Return the verdict of one run: its expectations, what it showed, and where its files are."""
    lines = [
        _head(summary),
        *(_expectation(row) for row in summary["expectations"]),
        f"  {_accuracy(summary)}",
        *_delivery(summary["delivery"]),
        *_rejected(summary["rejected_by_cause"]),
        _outcome(summary, folder / ("run.rrd" if recorded else "summary.json")),
        *([f"view it: qswarm view {folder}"] if recorded else []),
    ]
    return "\n".join(lines)


def table(overall: Overall, folder: Path) -> str:
    """Return a row for each of many runs, and for each scenario minimum, median and maximum."""
    width = max((len(row["run"]) for row in overall["rows"]), default=3)
    head = f"{'run':{width}}  separation  converged in  slot error  over turn limit  outcome"
    lines = [head, *(_run(row, width) for row in overall["rows"]), ""]
    for scenario in overall["scenarios"]:
        lines += _scenario(scenario)
    return "\n".join([*lines, _outcome(overall, folder / "summary.json")])


def verified(verification: "Verification") -> str:
    """Return what a recording shows by itself, and whether summary.json says the same."""
    rows: Iterable[ExpectationRow] = (
        {"name": row.name, "wanted": row.wanted, "got": row.got, "held": row.held}
        for row in verification.expectations
    )
    cut = "" if verification.whole else f" of {verification.duration_s:g} s"
    none = f"  no {SUMMARY_FILE} to compare with"
    agreement = [
        f"  DIFFERS  {each.key}: {each.summary} in summary.json, {each.recording} in the recording"
        for each in verification.differences
    ] or [f"  {SUMMARY_FILE} agrees" if verification.summary else none]
    head = (
        f"{verification.scenario}, judged from the recording alone:"
        f" {verification.ticks} ticks, {verification.until_s:g} s{cut}"
    )
    outcome = f"{_verified_outcome(verification)}  {verification.run}"
    return "\n".join([head, *map(_expectation, rows), *agreement, outcome])


def _verified_outcome(verification: "Verification") -> str:
    doubt = verification.inconclusive
    if doubt is not None:
        return f"inconclusive ({doubt})"
    return "met" if verification.held else "NOT MET"


def _head(summary: Summary) -> str:
    factor = summary["real_time_factor"]
    pace = f" at {factor:.3g} x real time" if factor is not None else ""
    return (
        f"{summary['scenario']}, seed {summary['seed']}, {MODE_WORDS[summary['mode']]}:"
        f" {summary['agents']} agents, {summary['duration_s']:g} s simulated{pace}"
    )


def _outcome(summary: Any, file: Path) -> str:
    reason = f" ({summary['reason']})" if summary["reason"] else ""
    return f"{summary['outcome']}{reason}  {file}"


def _expectation(row: ExpectationRow) -> str:
    return f"  {'met' if row['held'] else 'NOT MET':9}{_shown(row)}"


def _shown(row: ExpectationRow) -> str:
    """Return what a run showed of an expectation, beside what was required."""
    name, got, wanted = row["name"], row["got"], row["wanted"]
    limit = f" (limit {wanted:g} s)" if wanted is not None else ""
    match name:
        case "min_separation_m" | "min_obstacle_distance_m":
            what = name.removesuffix("_m").replace("min_", "minimum ").replace("_", " ")
            return f"{what}: {_figure(got, 'm', 3)} (required >= {wanted:g} m)"
        case "reform_within_s":
            if got is not None:
                return f"formation restored within {got:.3g} s of each team change{limit}"
            how = "no team change" if row["held"] else "formation not restored after a team change"
            return f"{how}{limit}"
        case _ if name.startswith(CONVERGE):
            how = f"converged in {got:.3g} s" if got is not None else "did not converge"
            return f"{name.removeprefix(CONVERGE)}: {how}{limit}"
    return f"{name}: {got} (required {wanted})"


def _accuracy(summary: Summary) -> str:
    residual = summary["phases"][-1]["residual_m"]
    turns = summary["turns_over_limit_fraction"]
    return (
        f"largest slot error at the end: {_figure(_mm(residual), 'mm', 2)};"
        f" steps over the turn limit: {_percent(turns)}"
    )


def _delivery(delivery: DeliveryRow | None) -> list[str]:
    """Return a line on how much later than due frames were used; none if not measured."""
    if delivery is None:
        return []
    extra, within = delivery["excess_ms"], delivery["within_fraction"]
    return [
        f"  extra delivery delay: median {extra['p50']:.1f} ms, 99th percentile"
        f" {extra['p99']:.1f} ms; {_percent(within, 2)} of frames within"
        f" {delivery['bound_ms']:g} ms (one slot and one tick)"
    ]


def _rejected(rejected: dict[str, dict[str, int]]) -> list[str]:
    """Return a line on rejected messages: how many by which component; none if there are none."""
    parts = [
        f"{_causes(causes)} (by {component})" for component, causes in rejected.items() if causes
    ]
    return [f"  rejected messages: {'; '.join(parts)}"] if parts else []


def _causes(causes: dict[str, int]) -> str:
    counts = ((count, CAUSE_WORDS.get(cause, cause)) for cause, count in causes.items())
    return ", ".join(f"{count} {words}" for count, words in counts)


def _run(row: Row, width: int) -> str:
    reason = f" ({row['reason']})" if row["reason"] else ""
    return (
        f"{row['run']:{width}}  {_figure(row['min_separation_m'], 'm', 3):>10}"
        f"  {_figure(row['converge_s'], 's', 2):>12}"
        f"  {_figure(_mm(row['residual_m']), 'mm', 2):>10}"
        f"  {_percent(row['turns_over_limit_fraction']):>15}  {row['outcome']}{reason}"
    )


def _scenario(scenario: ScenarioRow) -> list[str]:
    spreads = (
        ("separation", scenario["min_separation_m"], "m", 3),
        ("converged in", scenario["converge_s"], "s", 2),
    )
    doubtful = f", {scenario['inconclusive']} inconclusive" if scenario["inconclusive"] else ""
    return [
        f"{scenario['scenario']}: {scenario['pass']} of {scenario['runs']} runs passed{doubtful}",
        *(
            f"  {name:12}  min {_figure(spread['min'], unit, digits)},"
            f" median {_figure(spread['median'], unit, digits)},"
            f" max {_figure(spread['max'], unit, digits)} ({spread['measured']} runs)"
            for name, spread, unit, digits in spreads
            if spread is not None
        ),
    ]


def _mm(metres: float | None) -> float | None:
    return 1000.0 * metres if metres is not None else None


def _figure(value: float | None, unit: str, digits: int) -> str:
    return f"{value:.{digits}f} {unit}" if value is not None else "-"


def _percent(fraction: float | None, digits: int = 1) -> str:
    return f"{100 * fraction:.{digits}f} %" if fraction is not None else "-"
