"""The command about speed: ``bench``."""

import os
from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer

from worldsim.commands.options import examples
from worldsim.results.exit_status import PASS

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
    """Measure the CPU cost of agents, radio and recording.

    The figures are CPU time of one core, not wall time, though a busy host still adds to them.
    It takes about half a minute.
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
        goal = f"goal {'>=' if row.more else '<='} {row.goal:g}"
        verdict = "" if row.reached else "  not reached"
        print(f"{row.name:44} {row.measured:10.1f} {row.unit:18} {goal}{verdict}", flush=True)
    if json is not None:
        write_json(json, {"rows": rows})
    return PASS
