"""A sweep in words: its table of cells, where numbers break the team, and how to repeat a failure.

Pure.
"""

import shlex
from collections.abc import Iterable
from pathlib import Path

from worldsim.results.exit_status import INTERRUPTION
from worldsim.sweep.plan import Plan
from worldsim.sweep.result import CellRow, Rows, Summary

Row = tuple[str, ...]


def sweep_text(summary: Summary, folder: Path) -> str:
    """Return the table of a sweep's cells, its breaks and its outcome."""
    head, rows = cells_table(summary["cells"])
    return "\n".join(
        [
            *aligned([head, *rows]),
            *([""] if summary["breaks"] else []),
            *(f"{row['key']}{_where(row['where'])}: {row['text']}" for row in summary["breaks"]),
            "",
            closing_line(summary, folder),
        ]
    )


def cells_table(cells: list[CellRow]) -> tuple[Row, list[Row]]:
    """Return the head and the rows of the table of a sweep's cells, as texts."""
    keys = list(cells[0]["settings"])
    heads = ("flights", "pass", "share", "95 %", "converged in", "least separation")
    return (*keys, *heads), [_row(cell) for cell in cells]


def closing_line(summary: Summary, folder: Path) -> str:
    """Return a sweep's outcome with its reason, and where its files are, in one line.

    One that was interrupted has no outcome yet: the line tells how far it is.
    """
    passed = sum(cell["pass"] for cell in summary["cells"])
    file, reason = folder / "summary.json", summary["reason"]
    if reason is None:
        return f"{summary['outcome']}: {passed} of {summary['runs']} flights pass  {file}"
    failed = sum(cell["fail"] for cell in summary["cells"])
    so_far = f"{reason}, {passed} pass, {failed} fail"
    goes_on = f"the same command with --out {shlex.quote(str(folder))} goes on"
    outcome = "" if reason.startswith(INTERRUPTION) else f"{summary['outcome']}: "
    return f"{outcome}{so_far}; {goes_on}  {file}"


def repeat_text(plan: Plan, rows: Rows, command: str) -> str | None:
    """Return the command that repeats the first failed flight; None where none failed.

    command: how the scenario was given, with what was set for all cells.
    """
    failed = next((key for key in sorted(rows) if rows[key]["outcome"] == "fail"), None)
    if failed is None:
        return None
    settings = (f"{key}={value}" for key, value in plan.settings(failed.cell).items())
    chosen = " ".join(f"--set {shlex.quote(each)}" for each in settings)
    return f"repeat a failure: qswarm sim {command} --seed {failed.seed} {chosen}"


def aligned(rows: Iterable[tuple[str, ...]]) -> list[str]:
    """Return rows of cells as lines, the columns aligned."""
    listed = list(rows)
    widths = [max(len(row[index]) for row in listed) for index in range(len(listed[0]))]
    return [
        "  ".join(f"{text:{width}}" for text, width in zip(row, widths, strict=True)).rstrip()
        for row in listed
    ]


def settings_text(settings: dict[str, str]) -> str:
    """Return the values of some keys, such as "netem.delay_ms = 200, seed = 1"."""
    return ", ".join(f"{key} = {value}" for key, value in settings.items())


def figure_text(value: float | None, form: str = ".3g") -> str:
    """Return a figure, "-" where it was not measured."""
    return "-" if value is None else f"{value:{form}}"


def _row(cell: CellRow) -> tuple[str, ...]:
    low, high = cell["pass_share_low"], cell["pass_share_high"]
    bounds = "-" if low is None or high is None else f"{low:.2f} to {high:.2f}"
    converge_s, separation_m = (
        cell["medians"][name] for name in ("converge_s", "min_separation_m")
    )
    unjudged = f" ({cell['inconclusive']} inconclusive)" if cell["inconclusive"] else ""
    return (
        *cell["settings"].values(),
        str(cell["flights"]),
        f"{cell['pass']}{unjudged}",
        figure_text(cell["pass_share"], ".2f"),
        bounds,
        "-" if converge_s is None else f"{converge_s:.2f} s",
        "-" if separation_m is None else f"{separation_m:.3f} m",
    )


def _where(settings: dict[str, str]) -> str:
    return f" where {settings_text(settings)}" if settings else ""
