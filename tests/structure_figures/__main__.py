"""Measure how teams form, in virtual time: convergence, changes of place, traffic, CPU time.

    python -m tests.structure_figures --list
    python -m tests.structure_figures 'wedge-9-*' --seeds 0:20 --jobs 2 --out now.json
    python -m tests.structure_figures 'wedge-*' --set control.spacing_m=1.5 --beside now.json

exact: seeds in which the team took exactly the layout's places, each agent within 0.12 m of its
own for 2 s; the times are from the stage's start. bound: the best assignment flown straight,
median/max. changes: of place, for each agent after its first claim, until the convergence: mean,
and the most of any agent; after: all changes in the 60 s after it, at most until the next stage;
away: for how long the team was out of its places then, at most. B/s: of an agent, checksum
included. CPU: of one flight. broken: invariants, and in how many seeds. failed: seeds that did not
converge exactly, changed a place afterwards, broke an invariant or did not end.

Exit status 1 where a flight did not end.
"""

import argparse
import json
import sys
from fnmatch import fnmatch
from pathlib import Path
from typing import Any

import typer

from tests.structure_figures.flights import rows_flown
from tests.structure_figures.rows import ROWS, scenario_of
from tests.structure_figures.table import HEADER, lines
from worldsim.commands.options import overrides_of, seeds_of
from worldsim.results.progress_line import ProgressLine
from worldsim.scenario.toml import ScenarioError


def arguments() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("rows", nargs="*", metavar="ROW", help="names, or patterns of names")
    parser.add_argument("--list", action="store_true", help="print the names of all rows")
    parser.add_argument("--seeds", default="0:20", metavar="FIRST:END")
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--set", action="append", metavar="KEY=VALUE", help="any scenario key")
    parser.add_argument("--deadline", type=float, default=3600.0, help="of one flight [s]")
    parser.add_argument("--out", type=Path, help="file for the figures of each seed, as JSON")
    parser.add_argument(
        "--beside", type=Path, nargs="*", default=[], help="such files, to print beside"
    )
    return parser


def chosen(patterns: list[str]) -> list[str]:
    """Return the names that match any pattern. Raises ValueError for a pattern without a match."""
    for pattern in patterns:
        if not any(fnmatch(name, pattern) for name in ROWS):
            raise ValueError(f"{pattern}: no such row; --list prints all")
    return [name for name in ROWS if any(fnmatch(name, each) for each in patterns)]


def main() -> int:
    given = arguments().parse_args()
    if given.list or not given.rows:
        print("\n".join(ROWS))
        return 0
    try:
        names, seeds = chosen(given.rows), seeds_of(given.seeds)
        settings = overrides_of(given.set, None, None, None)
        if given.out is not None and given.out.exists():
            raise ValueError(f"{given.out}: exists; nothing is overwritten")
        others = {file.stem: json.loads(file.read_text())["rows"] for file in given.beside}
        for name in names:
            scenario_of(ROWS[name]._replace(by_sides=False), seeds[0], settings)
    except (ScenarioError, typer.BadParameter, ValueError, OSError) as error:
        print(error, file=sys.stderr)
        return 2
    return measure(given, names, seeds, settings, others)


def measure(
    given: argparse.Namespace,
    names: list[str],
    seeds: range,
    settings: dict[str, str],
    others: dict[str, Any],
) -> int:
    """Fly the rows and print each as it is done; return the exit status."""
    line, rows, failed = ProgressLine(), {}, False
    print(HEADER, flush=True)
    for name, flown in rows_flown(names, seeds, settings, given.jobs, given.deadline, line.update):
        line.clear()
        rows[name] = flown
        failed |= any("failure" in each for each in flown)
        print("\n".join(lines(name, flown)), flush=True)
        for label, known in others.items():
            if name in known:
                print("\n".join(lines(f"  {label}", known[name])), flush=True)
        if given.out is not None:
            given.out.write_text(json.dumps({"settings": settings, "rows": rows}, indent=1))
    line.clear()
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
