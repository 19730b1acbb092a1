"""The command about speed: ``bench``."""

import os
import sys
from collections.abc import Iterator
from pathlib import Path
from time import monotonic
from typing import TYPE_CHECKING, Annotated

import typer

from worldsim.commands.options import complain, examples
from worldsim.results.exit_status import FAIL, INTERRUPTED, PASS

if TYPE_CHECKING:
    from worldsim.bench.comparison import Change
    from worldsim.bench.measures import Measure, Row
    from worldsim.bench.saved_figures import Saved

commands = typer.Typer()


@commands.command(
    epilog=examples(
        "qswarm bench",
        "qswarm bench --save before.json",
        "qswarm bench --against before.json --fail-over 20",
        'qswarm bench --only "agent step*" --only "medium*" --repeats 5',
        'qswarm bench --processes --only "processes, N = 25*"',
    )
)
def bench(
    repeats: Annotated[
        int,
        typer.Option(
            metavar="N", min=1, max=100, help="Measurements of each figure; the best one counts."
        ),
    ] = 3,
    only: Annotated[
        list[str] | None,
        typer.Option(
            metavar="PATTERN", help="Measure only rows of such names (* for any text); repeatable."
        ),
    ] = None,
    processes: Annotated[
        bool,
        typer.Option(
            "--processes",
            help="Also fly fleets of 10 to 100 real processes, and 20 in lockstep: four minutes.",
        ),
    ] = False,
    seconds: Annotated[
        float | None,
        typer.Option(
            metavar="T",
            min=1.0,
            max=3600.0,
            help="How long each fleet of processes flies.",
            show_default="20 to 60, by its size",
        ),
    ] = None,
    save: Annotated[
        Path | None,
        typer.Option(
            "--save", "--json", metavar="FILE", help="Also write the figures to a new JSON file."
        ),
    ] = None,
    against: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE", help="Print the ratio to the figures saved there, and what got worse."
        ),
    ] = None,
    fail_over: Annotated[
        float | None,
        typer.Option(
            metavar="PERCENT",
            min=0.0,
            max=1e6,
            help="Exit with 1 if a figure is worse by more (needs --against).",
        ),
    ] = None,
) -> int:
    """Measure the cost of agents, radio and recording: CPU time, and bytes on the air.

    The CPU time is that of one core, not wall time, though a busy host still adds to it. Rows of
    whole teams, and of fleets of processes, are measured once. It takes about two minutes.
    """
    from netem.wire.shutdown import interrupt_on_signals
    from worldsim.bench.circumstances import circumstances
    from worldsim.bench.comparison import MARKED_PERCENT
    from worldsim.bench.lines import summary_line
    from worldsim.bench.saved_figures import content, of, saved
    from worldsim.results.run_folder import write_json

    if fail_over is not None and against is None:
        raise typer.BadParameter("needs --against", param_hint="--fail-over")
    measures = _chosen(processes, seconds, only or [])
    _check_writable(save)
    before = saved(against) if against is not None else None
    if against is not None and before is not None and fail_over is not None:
        _check_comparable(measures, before, against)
    interrupt_on_signals()  # the fleet of the moment ends, and what was measured is saved
    measured_with = circumstances()
    print(f"code: {measured_with['code']}", flush=True)
    if before is not None:
        _warn(of(content([], measured_with, repeats, seconds)), before)
    marked = MARKED_PERCENT if fail_over is None else fail_over  # what fails is what is marked
    rows, changes, interrupted = _printed(measures, repeats, before, marked)
    if save is not None and rows:
        write_json(save, content(rows, measured_with, repeats, seconds))
    if interrupted:
        saved_in = f"; {len(rows)} of {len(measures)} rows are in {save}" if save and rows else ""
        complain(f"qswarm: interrupted{saved_in}")
        return INTERRUPTED
    if before is not None:
        print(summary_line(changes, str(against), marked))
    failed = fail_over is not None and any(each.worse_by(fail_over) for each in changes.values())
    return FAIL if failed else PASS


def _chosen(processes: bool, seconds: float | None, only: list[str]) -> "list[Measure]":
    """Return the rows to measure. Raises typer.BadParameter."""
    from worldsim.bench import process_costs, table
    from worldsim.bench.measures import chosen

    if seconds is not None and not processes:
        raise typer.BadParameter("needs --processes", param_hint="--seconds")
    fleets = process_costs.measures(seconds)
    try:
        return chosen([*table.MEASURES, *(fleets if processes else ())], only)
    except LookupError as error:
        pattern = str(error.args[0])
    try:
        chosen(fleets, [pattern])
    except LookupError:
        detail = f"no row matches {pattern!r}; a name as it is printed, or with * for any text"
    else:
        detail = f"{pattern!r} needs --processes"
    raise typer.BadParameter(detail, param_hint="--only")


def _check_writable(file: Path | None) -> None:
    from worldsim.scenario.toml import ScenarioError

    if file is not None and file.exists():
        raise ScenarioError(file, "", "exists; nothing is overwritten")
    if file is not None and not os.access(file.parent, os.W_OK):
        raise ScenarioError(file, "", "cannot be written: no such folder, or not writable")


def _check_comparable(measures: "list[Measure]", before: "Saved", file: Path) -> None:
    """Raise ScenarioError if none of the rows to measure has a figure in the file."""
    from worldsim.bench.comparison import incomparable
    from worldsim.scenario.toml import ScenarioError

    then = {row.name: row for row in before.rows}
    if all(incomparable(measure, then.get(measure.name)) for measure in measures):
        raise ScenarioError(
            file, "rows", "--fail-over has nothing to compare with what is measured"
        )


def _warn(now: "Saved", then: "Saved") -> None:
    from worldsim.bench.comparison import differences

    for difference in differences(now, then):
        complain(f"warning: {difference}")


def _printed(
    measures: "list[Measure]", repeats: int, before: "Saved | None", marked: float
) -> "tuple[list[Row], dict[str, Change], bool]":
    """Measure and print all rows; return them, their changes by name, and whether Ctrl-C came."""
    from worldsim.bench.comparison import change
    from worldsim.bench.lines import line

    then = {row.name: row for row in before.rows} if before is not None else {}
    rows, changes = [], {}
    try:
        for measure, row in _measured(measures, repeats):
            rows.append(row)
            if before is not None:
                changes[row.name] = change(row, then.get(row.name), measure.grain)
            print(line(row, changes.get(row.name), marked), flush=True)
    except KeyboardInterrupt:
        return rows, changes, True
    return rows, changes, False


def _measured(measures: "list[Measure]", repeats: int) -> "Iterator[tuple[Measure, Row]]":
    """Measure all rows; those that take over two seconds are shown on stderr meanwhile."""
    from worldsim.bench.measures import measured_row
    from worldsim.bench.ticking import ticking
    from worldsim.results.progress_line import ProgressLine

    for number, measure in enumerate(measures, 1):
        progress, began_s = ProgressLine(sys.stderr), monotonic()
        name = f"{number} of {len(measures)}: {measure.name}"
        try:
            with ticking(lambda: progress.update(f"{name}, {monotonic() - began_s:.0f} s")):  # noqa: B023 - called within this turn
                row = measured_row(measure, repeats)
        finally:
            progress.clear()
        yield measure, row
