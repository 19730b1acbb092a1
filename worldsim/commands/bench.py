"""The command about speed: qswarm bench."""

from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer

Repeats = Annotated[
    int, typer.Option(min=1, max=100, help="How often each is measured; the best counts.")
]
Json = Annotated[
    Path | None,
    typer.Option("--json", metavar="FILE", help="Where the figures go besides, as JSON."),
]


def bench(repeats: Repeats = 3, json: Json = None) -> int:
    """Measure what a control step, a frame in the medium, virtual time and a recording cost.

    CPU time of one core, never the wall clock; a busy host still adds to it. Takes half a minute.
    """
    from worldsim.bench.table import measured
    from worldsim.results.run_folder import write_json
    from worldsim.scenario.toml import ScenarioError

    if json is not None and json.exists():
        raise ScenarioError(json, "", "exists; nothing is overwritten")
    rows = []
    for row in measured(repeats):
        rows.append({**asdict(row), "reached": row.reached})
        against = f"goal {'>=' if row.more else '<='} {row.goal:g}"
        verdict = "" if row.reached else "  not reached"
        print(f"{row.name:44} {row.measured:10.1f} {row.unit:18} {against}{verdict}", flush=True)
    if json is not None:
        write_json(json, {"rows": rows})
    return 0
