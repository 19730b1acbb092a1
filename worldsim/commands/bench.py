"""The command about speed: ``bench``."""

import os
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from worldsim.commands.options import examples
from worldsim.results.exit_status import PASS

if TYPE_CHECKING:
    from worldsim.bench.table import Row

commands = typer.Typer()


@commands.command(epilog=examples("qswarm bench", "qswarm bench --repeats 5 --json speed.json"))
def bench(
    repeats: Annotated[
        int,
        typer.Option(
            metavar="N", min=1, max=100, help="Measurements of each figure; the best one counts."
        ),
    ] = 3,
    json: Annotated[
        Path | None,
        typer.Option("--json", metavar="FILE", help="Also write the figures as JSON."),
    ] = None,
) -> int:
    """Measure the cost of agents, radio and recording: CPU time, and bytes on the air.

    The CPU time is that of one core, not wall time, though a busy host still adds to it. Rows of
    whole teams are measured once. It takes about two minutes.
    """
    from worldsim.bench.table import measured
    from worldsim.results.run_folder import write_json
    from worldsim.scenario.toml import ScenarioError

    if json is not None and json.exists():
        raise ScenarioError(json, "", "exists; nothing is overwritten")
    if json is not None and not os.access(json.parent, os.W_OK):
        raise ScenarioError(json, "", "cannot be written: no such folder, or not writable")
    rows = []
    for row in measured(repeats):
        rows.append({**asdict(row), "reached": row.reached})
        print(_line(row), flush=True)
    if json is not None:
        write_json(json, {"rows": rows})
    return PASS


def _line(row: "Row") -> str:
    """Return a row as it is printed."""
    figure = f"{row.measured:10.2f}" if row.unit == "x" else f"{row.measured:10.1f}"
    line = f"{row.name:44} {figure} {row.unit}"
    if row.goal is None:
        return line
    verdict = "" if row.reached else "  not reached"
    return f"{line:73} goal {'>=' if row.more else '<='} {row.goal:g}{verdict}"
