"""The commands about many flights: ``sweep`` flies a grid by seeds, ``compare`` compares two."""

import shlex
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from worldsim.commands.options import (
    Agents,
    Duration,
    Json,
    Quiet,
    ScenarioFile,
    Seeds,
    Settings,
    complain,
    examples,
    load_scenario,
    overrides_of,
    seeds_of,
)
from worldsim.commands.sites import Cluster, FlightsAtOnce, flight_site
from worldsim.results.exit_status import PASS

if TYPE_CHECKING:
    from worldsim.results.progress_line import ProgressLine
    from worldsim.scenario.tables import Scenario
    from worldsim.sweep.plan import FlightKey, Plan
    from worldsim.sweep.result import Summary
    from worldsim.sweep.run_pair import RunPair
    from worldsim.sweep.sweep import Sweep
    from worldsim.sweep.sweep_pair import SweepPair

commands = typer.Typer()


@commands.command(
    epilog=examples(
        "qswarm sweep wedge-9 --vary netem.loss_percent=0,30,50,80",
        "qswarm sweep wedge-9 --vary netem.loss_percent=0,50 --vary netem.delay_ms=0,200,500",
        "qswarm sweep my.toml --vary control.controller=q_structure,my_package.module:Mine",
        "qswarm sweep my.toml --vary control.parameters.gain=0.5,1,2 --seeds 0:50 --jobs 2",
        "qswarm sweep wedge-9 --vary fleet.agents=9,12,15 --out runs/growth    # again: goes on",
        "qswarm sweep wedge-9 --vary netem.delay_ms=0,500 --cluster tcp://10.0.0.5:8786",
    )
)
def sweep(
    scenario: ScenarioFile,
    vary: Annotated[
        list[str],
        typer.Option(
            metavar="KEY=A,B,...",
            help="A key of the scenario and its values; repeatable, for every combination.",
        ),
    ],
    seeds: Seeds = "0:20",
    jobs: FlightsAtOnce = None,
    cluster: Cluster = None,
    agents: Agents = None,
    duration: Duration = None,
    settings: Settings = None,
    out: Annotated[
        Path | None,
        typer.Option(
            metavar="DIR",
            help="Output directory; that of the same sweep goes on where it was cut off.",
            show_default="runs/sweep-SCENARIO-TIME",
        ),
    ] = None,
    quiet: Quiet = False,
    json: Json = False,
) -> int:
    """Fly every combination of some keys' values with many seeds, and say where the team breaks.

    In virtual time, as `qswarm sim` does. DIR gets a line for each flight as it ends, and at the
    end a table of flights and one of cells (Parquet and CSV), the share of passes with its
    interval, the value at which each number breaks the team, and figures (SVG and PNG).
    """
    from worldsim.results.progress_line import ProgressLine
    from worldsim.results.run_folder import folder_named_after_now
    from worldsim.sweep.journal import Journal
    from worldsim.sweep.sweep import SCRATCH, fly, identity_of
    from worldsim.sweep.sweep_text import repeat_text

    base = overrides_of(settings, agents, None, duration)
    plan = _plan(vary, seeds, base)
    line = ProgressLine(hidden=quiet)
    flown = _loaded(scenario, plan, base, line)
    folder = out or folder_named_after_now(f"sweep-{flown.name}")
    with flight_site(cluster, jobs, flown.scenarios.values(), folder / SCRATCH) as site:
        journal = Journal(folder, identity := identity_of(flown))
        if journal.rows and identity["commit_dirty"]:
            complain(f"{folder}: warning: qswarm's own files differ from its commit, then or now")
        try:
            ended = fly(flown, journal, site, line)
        finally:
            line.clear()
            journal.close()
    _tell(ended.summary, folder, quiet, json)
    repeat = repeat_text(plan, journal.rows, _given(scenario, base))
    if repeat is not None and not quiet:
        print(repeat, file=sys.stderr if json else sys.stdout)
    return ended.status


@commands.command(
    epilog=examples(
        "qswarm compare runs/before runs/after",
        "qswarm compare runs/sweep-before runs/sweep-after",
        "qswarm compare runs/mine-twenty runs/theirs-twenty    # each of qswarm sim --seeds 0:20",
        "qswarm compare runs/before runs/after --json | jq .parting",
    )
)
def compare(
    first: Annotated[Path, typer.Argument(metavar="A", help="A run, a sweep, or many runs.")],
    second: Annotated[Path, typer.Argument(metavar="B", help="Another of the same kind.")],
    json: Annotated[
        bool, typer.Option("--json", help="Print one JSON document instead of words.")
    ] = False,
) -> int:
    """Compare two runs, or two sweeps by cell and seed.

    Of two runs: their figures side by side, the keys in which their scenarios differ, and the first
    tick at which their traces part. Of two sweeps, or two folders of many seeds: each figure's
    difference between flights of the same cell and seed, with its 95 % interval.
    """
    import json as json_format

    from worldsim.sweep.pair_text import run_pair_text, sweep_pair_text
    from worldsim.sweep.run_pair import compare_runs, is_run, read_side
    from worldsim.sweep.sweep_pair import compare_sweeps, is_many, read_flights

    kinds = [
        "one run" if is_run(each) else "many runs" if is_many(each) else ""
        for each in (first, second)
    ]
    _check_kinds((first, second), kinds)
    pair: RunPair | SweepPair
    if kinds[0] == "one run":
        pair = compare_runs(read_side(first), read_side(second))
        words = run_pair_text(pair)
    else:
        pair = compare_sweeps((first, second), read_flights(first), read_flights(second))
        words = sweep_pair_text(pair)
    print(json_format.dumps(pair, indent=2, allow_nan=False) if json else words)
    return PASS


def _check_kinds(folders: tuple[Path, Path], kinds: list[str]) -> None:
    """Raise RunDirectoryError for what is no run, and for a run with a sweep."""
    from worldsim.results.run_folder import RunDirectoryError

    for folder, kind in zip(folders, kinds, strict=True):
        if not kind:
            why = "holds no finished run and no sweep" if folder.exists() else "no such folder"
            raise RunDirectoryError(folder, why)
    if kinds[0] != kinds[1]:
        detail = f"holds {kinds[1]}, and {folders[0]} holds {kinds[0]}: compare two of a kind"
        raise RunDirectoryError(folders[1], detail)


def _plan(vary: list[str], seeds: str, base: Mapping[str, str]) -> "Plan":
    """Return what is to be flown. Raises typer.BadParameter."""
    from worldsim.sweep.plan import Plan, PlanError, axis_of

    try:
        plan = Plan(tuple(axis_of(text) for text in vary), seeds_of(seeds))
    except PlanError as error:
        raise typer.BadParameter(str(error), param_hint="--vary") from error
    both = next((axis.key for axis in plan.axes if axis.key in base), None)
    if both is not None:
        raise typer.BadParameter(f"{both}: is set as well (--set)", param_hint="--vary")
    return plan


def _loaded(given: str, plan: "Plan", base: Mapping[str, str], line: "ProgressLine") -> "Sweep":
    """Return the scenario of every flight, checked. Raises ScenarioError."""
    from worldsim.engine.preflight import VIRTUAL_COMMAND_TICKS
    from worldsim.scenario.rules import warnings_for
    from worldsim.sweep.sweep import Sweep

    scenarios: dict[FlightKey, Scenario] = {}
    warnings: dict[str, None] = {}
    for key in plan.flights():
        own = {**base, **plan.settings(key.cell), "seed": str(key.seed)}
        scenarios[key] = load_scenario(given, own, VIRTUAL_COMMAND_TICKS)
        line.update(f"checked {len(scenarios)} of {len(plan)} flights")
        if key.seed == plan.seeds.start:
            found = warnings_for(scenarios[key])
            warnings |= {f"{given}: {each.key}: warning: {each.detail}": None for each in found}
    line.clear()
    for warning in warnings:
        complain(warning)
    return Sweep(plan, scenarios)


def _given(scenario: str, base: Mapping[str, str]) -> str:
    """Return how the scenario was given, with what was set for all cells."""
    settings = (f"--set {shlex.quote(f'{key}={value}')}" for key, value in base.items())
    return " ".join((shlex.quote(scenario), *settings))


def _tell(summary: "Summary", folder: Path, quiet: bool, json: bool) -> None:
    import json as json_format

    from worldsim.sweep.sweep_text import closing_line, sweep_text

    if not (quiet and json):
        words = closing_line(summary, folder) if quiet else sweep_text(summary, folder)
        print(words, file=sys.stderr if json else sys.stdout)
    if json:
        print(json_format.dumps(summary, indent=2, allow_nan=False))
