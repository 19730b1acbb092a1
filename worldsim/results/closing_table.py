"""The verdict of one run on a terminal: a table in colour, with the same words as elsewhere."""

from pathlib import Path
from typing import TextIO, cast

from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.table import Table
from rich.text import Text

from worldsim.judge.finding import ExpectationRow
from worldsim.results.expectation_text import expectation_cells, was_tested
from worldsim.results.output_streams import Unescaped, escaped
from worldsim.results.summary import Summary
from worldsim.results.verdict_text import (
    circumstances,
    closing_line,
    head,
    hints,
    remarks,
    violation_text,
)

MET, NOT_MET, OPEN, UNTESTED = "green", "bold red", "yellow", "dim"
OUTCOME_STYLES = {"pass": "bold green", "fail": "bold red", "inconclusive": "bold yellow"}


def show_verdict(stream: TextIO, summary: Summary, folder: Path, recorded: bool) -> None:
    """Draw the verdict of one run on a terminal that ``stream`` writes to."""
    draw_verdict(Console(file=cast(TextIO, Unescaped(stream))), summary, folder, recorded)


def draw_verdict(console: Console, summary: Summary, folder: Path, recorded: bool) -> None:
    """Draw the verdict of one run: expectations as a table, invariants and the rest as lines."""
    _line(console, head(summary), "bold")
    console.print(_table(summary))
    for text, style in _invariants(summary):
        _line(console, f"  {text}", style)
    for text in remarks(summary):
        _line(console, text)
    _line(console, closing_line(summary, folder, recorded), OUTCOME_STYLES[summary["outcome"]])
    for text in hints(folder, recorded):
        _line(console, text)


def _line(console: Console, text: str, style: str = "") -> None:
    console.print(Text(escaped(text), style=style), soft_wrap=True)


def _table(summary: Summary) -> Table:
    table = Table(box=SIMPLE_HEAD, pad_edge=False)
    table.add_column("expectation")
    table.add_column("required", no_wrap=True)
    table.add_column("got", overflow="fold")
    table.add_column("margin", no_wrap=True)
    table.add_column("", no_wrap=True)
    rows = summary["expectations"]
    for row, cells in zip(rows, expectation_cells(rows, circumstances(summary)), strict=True):
        word, style = _result(row)
        table.add_row(*(Text(escaped(cell)) for cell in cells), Text(word, style=style))
    return table


def _result(row: ExpectationRow) -> tuple[str, str]:
    if row["held"] is None:
        return "not judged", OPEN
    if not was_tested(row):
        return "not tested", UNTESTED
    return ("met", MET) if row["held"] else ("NOT MET", NOT_MET)


def _invariants(summary: Summary) -> list[tuple[str, str]]:
    """Return lines on the invariants, each with its style."""
    tallies = summary["invariants"]
    doubtful = summary["outcome"] == "inconclusive"
    word, style = ("violated, not judged", OPEN) if doubtful else ("FAIL", NOT_MET)
    lines = [
        (f"{word}: {violation_text(name, tally)}", style)
        for name, tally in tallies.items()
        if tally["violations"]
    ]
    kept = [name for name, tally in tallies.items() if tally["ticks"] and not tally["violations"]]
    unseen = [name for name, tally in tallies.items() if not tally["ticks"]]
    if kept:
        lines.append((f"invariants held: {', '.join(kept)}", MET))
    if unseen:
        lines.append((f"invariants never evaluated: {', '.join(unseen)}", OPEN))
    return lines
