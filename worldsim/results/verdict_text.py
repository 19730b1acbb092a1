"""What a run says in a terminal: one line while it flies, the verdict, the table over many."""

import sys
from pathlib import Path
from time import monotonic
from typing import TYPE_CHECKING, Any, TextIO

if TYPE_CHECKING:
    from worldsim.recording.verify import Verification

Summary = dict[str, Any]

QUIET_S = 2.0
LINE_EVERY_S = 0.2
LOG_EVERY_S = 5.0


class ProgressLine:
    """One line for what takes over two seconds; now and then a line where there is no terminal."""

    def __init__(self, stream: TextIO | None = None) -> None:
        self._stream = stream if stream is not None else sys.stderr
        self._next_s = monotonic() + QUIET_S
        self._shown = False

    def tell(self, text: str) -> None:
        """Show how far it is, if it is time to."""
        if monotonic() < self._next_s:
            return
        alive = self._stream.isatty()
        self._next_s = monotonic() + (LINE_EVERY_S if alive else LOG_EVERY_S)
        self._stream.write(f"\r\x1b[K{text}" if alive else f"{text}\n")
        self._stream.flush()
        self._shown = alive

    def clear(self) -> None:
        """Take the line away."""
        if self._shown:
            self._stream.write("\r\x1b[K")
            self._stream.flush()


def verdict(summary: Summary, folder: Path, recorded: bool) -> str:
    """Return the verdict of one run: what was expected, what it showed, where to look."""
    factor = summary["real_time_factor"]
    pace = f", {factor:.3g} times real time" if factor is not None else ""
    head = (
        f"{summary['scenario']}, seed {summary['seed']}: {summary['agents']} agents,"
        f" {summary['duration_s']:g} s{pace}"
    )
    rows = [_expectation(**row) for row in summary["expectations"]]
    reason = f" ({summary['reason']})" if summary["reason"] else ""
    place = f"{folder}/run.rrd" if recorded else f"{folder}/summary.json"
    refused = _refused(summary["rejected_by_cause"])
    told = [_aside(summary), *_delivery(summary["delivery"]), *refused]
    return "\n".join([head, *rows, *told, f"{summary['outcome']}{reason}  {place}"])


def table(overall: Summary, folder: Path) -> str:
    """Return the table over many runs: a line for each, least, median and most of each scenario."""
    width = max((len(row["run"]) for row in overall["rows"]), default=3)
    head = f"{'run':{width}}  separation   converge   residual  turns  outcome"
    lines = [head, *(_run(row, width) for row in overall["rows"]), ""]
    for scenario in overall["scenarios"]:
        lines += _scenario(scenario)
    reason = f" ({overall['reason']})" if overall["reason"] else ""
    return "\n".join([*lines, f"{overall['outcome']}{reason}  {folder}/summary.json"])


def verified(verification: "Verification") -> str:
    """Return what a recording shows by itself, and whether the run's summary says the same."""
    rows = [
        _expectation(row.name, row.wanted, row.got, row.held) for row in verification.expectations
    ]
    cut = "" if verification.whole else f" of {verification.duration_s:g} s"
    agreement = [
        f"  DIFFERS  {each.key}: {each.summary} in the summary, {each.recording} in the recording"
        for each in verification.differences
    ] or ["  the summary agrees" if verification.summary else "  no summary to compare with"]
    head = (
        f"{verification.scenario}, from its recording alone:"
        f" {verification.ticks} ticks, {verification.until_s:g} s{cut}"
    )
    outcome = "held" if verification.held else "NOT HELD"
    return "\n".join([head, *rows, *agreement, f"{outcome}  {verification.run}"])


def _expectation(name: str, wanted: float | None, got: float | None, held: bool) -> str:
    asked = f"wanted {wanted:g}" if wanted is not None else "wanted at all"
    shown = f"{got:.3g}" if got is not None else "never"
    return f"  {'held' if held else 'NOT HELD':9}{name}: {shown} ({asked})"


def _refused(rejected: dict[str, dict[str, int]]) -> list[str]:
    """Return who refused what in a line, or none where nothing was refused."""
    told = [
        f"{who} {', '.join(f'{count} {cause}' for cause, count in causes.items())}"
        for who, causes in rejected.items()
        if causes
    ]
    return [f"  refused: {'; '.join(told)}"] if told else []


def _delivery(delivery: dict[str, Any] | None) -> list[str]:
    """Return how late frames were used in a line, or none where that was not measured."""
    if delivery is None:
        return []
    late, within = delivery["excess_ms"], delivery["within_fraction"]
    return [
        f"  frames used {late['p50']:.1f} ms (median), {late['p99']:.1f} ms (p99) after due,"
        f" {_percent(within, 2)} within {delivery['bound_ms']:g} ms, a slot and a tick"
    ]


def _aside(summary: Summary) -> str:
    residual = summary["phases"][-1]["residual_m"]
    turns = summary["turns_over_limit_fraction"]
    return f"  residual {_figure(_mm(residual), 'mm', 2)}, turns over the limit {_percent(turns)}"


def _run(row: Summary, width: int) -> str:
    reason = f" ({row['reason']})" if row["reason"] else ""
    return (
        f"{row['run']:{width}}  {_figure(row['min_separation_m'], 'm', 3):>10}"
        f"  {_figure(row['converge_s'], 's', 2):>9}  {_figure(_mm(row['residual_m']), 'mm', 2):>9}"
        f"  {_percent(row['turns_over_limit_fraction']):>5}  {row['outcome']}{reason}"
    )


def _scenario(scenario: Summary) -> list[str]:
    spreads = (
        ("separation", scenario["min_separation_m"], "m", 3),
        ("converge", scenario["converge_s"], "s", 2),
    )
    return [
        f"{scenario['scenario']}: {scenario['pass']} of {scenario['runs']} passed",
        *(
            f"  {name:10}  least {_figure(spread['min'], unit, digits)},"
            f" median {_figure(spread['median'], unit, digits)},"
            f" most {_figure(spread['max'], unit, digits)} ({spread['measured']} runs)"
            for name, spread, unit, digits in spreads
            if spread is not None
        ),
    ]


def _mm(metres: float | None) -> float | None:
    return 1000.0 * metres if metres is not None else None


def _figure(value: float | None, unit: str, digits: int) -> str:
    return f"{value:.{digits}f} {unit}" if value is not None else "-"


def _percent(fraction: float | None, digits: int = 1) -> str:
    return f"{100 * fraction:.{digits}f}%" if fraction is not None else "-"
