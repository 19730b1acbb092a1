"""The commands that search for trouble: ``fuzz`` and ``cause``."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from worldsim.commands.options import (
    Quiet,
    Seeds,
    Settings,
    complain,
    examples,
    load_scenario,
    overrides_of,
    seeds_of,
    warn,
)
from worldsim.commands.sites import Cluster, FlightsAtOnce, flight_site, local_site
from worldsim.results.exit_status import FAIL, INTERRUPTED, PASS

if TYPE_CHECKING:
    from worldsim.scenario.tables import Scenario
    from worldsim.search.trials import Terms

commands = typer.Typer()


@commands.command(
    epilog=examples(
        "qswarm fuzz --seeds 0:100 --out runs/fuzz",
        "qswarm fuzz --controller carousel.ring:Carousel --safety-only --out runs/carousel",
        "qswarm fuzz --base wedge-9 --seeds 0:1000 --jobs 2 --out runs/wedge",
        "qswarm fuzz --corpus corpus --seeds 0:1000 --out runs/tonight",
        "qswarm fuzz --seeds 0:10000 --cluster tcp://10.0.0.5:8786 --out runs/weekend",
        "qswarm sim runs/fuzz/findings/I4-13/scenario.toml",
        "qswarm cause runs/fuzz/findings/I4-13",
    )
)
def fuzz(
    out: Annotated[
        Path,
        typer.Option(
            metavar="DIR",
            help="Folder of the search: new, or one to go on with (same options, more seeds).",
        ),
    ],
    seeds: Seeds = "0:100",
    controller: Annotated[
        str | None,
        typer.Option(
            metavar="C", help="A shipped controller's name, or package.module:Class of your own."
        ),
    ] = None,
    base: Annotated[
        str | None,
        typer.Option(
            metavar="SCENARIO",
            help="Vary seed, radio and faults of this scenario.",
        ),
    ] = None,
    settings: Settings = None,
    safety_only: Annotated[
        bool,
        typer.Option(
            "--safety-only", help="Expect no formation: for a controller that forms none."
        ),
    ] = False,
    jobs: FlightsAtOnce = None,
    cluster: Cluster = None,
    guided: Annotated[
        bool | None,
        typer.Option(
            "--guided/--random",
            help="Let odd seeds lower the margin, or draw all at random.",
            show_default="guided where optuna is installed",
        ),
    ] = None,
    shrink: Annotated[
        int,
        typer.Option(metavar="N", min=0, help="How many findings of each property are shrunk."),
    ] = 3,
    corpus: Annotated[
        Path | None,
        typer.Option(
            metavar="DIR",
            help="Findings of earlier searches: flown again first; new ones are added.",
        ),
    ] = None,
    first_only: Annotated[
        bool,
        typer.Option("--first-only", help="End the search soon after the first violation."),
    ] = False,
    quiet: Quiet = False,
) -> int:
    """Search random scenarios for one that breaks a controller, and make it small.

    Each seed is a scenario of a minute or more of virtual time: first faults of all kinds hurt the
    team, and it must stay safe; then all of them end, and it must form its formation and stay so.
    DIR/seeds.jsonl has a line for each seed with its margins. A seed that fails becomes
    DIR/findings/NAME/scenario.toml, which `qswarm sim` replays, and finding.md, which explains it.
    Ctrl-C stops the search; the same command goes on with it. Exit status 1: a violation was found.
    """
    from worldsim.fuzz.flights import WORK
    from worldsim.fuzz.fuzz import Search
    from worldsim.fuzz.fuzz import fuzz as search_for_trouble

    wanted = seeds_of(seeds)
    varied = _base(controller, base, settings)
    terms, described = _terms(controller, base, varied, safety_only)
    by_margin = _guided(guided)
    if corpus is not None and not corpus.is_dir():
        raise typer.BadParameter(f"{corpus}: no such folder; make it first", param_hint="--corpus")
    with flight_site(cluster, jobs, [varied], out / WORK) as site:
        search = Search(
            terms=terms,
            seeds=wanted,
            folder=out,
            site=site,
            guided=by_margin,
            shrinks=shrink,
            corpus=corpus,
            described={**described, "first seed": wanted.start, "guided": by_margin},
            beside=Path("drawn.toml"),
            quiet=quiet,
            first_only=first_only,
        )
        return search_for_trouble(search)


def _terms(
    controller: str | None, base: str | None, varied: "Scenario", safety_only: bool
) -> "tuple[Terms, dict[str, Any]]":
    """Return what all trials share, and what search.json says of it."""
    from hashlib import sha256

    import msgspec

    from worldsim.scenario.file import dump
    from worldsim.search.drafts import cautions
    from worldsim.search.trials import Terms

    described = {
        "controller": controller,
        "base": base,
        "base's digest": base and sha256(dump(varied).encode()).hexdigest()[:12],
        "safety only": safety_only,
        **_code(varied),
    }
    tables = None if base is None else msgspec.to_builtins(varied)
    allowed = frozenset() if base is None else cautions(varied)
    return Terms(controller, tables, allowed, safety_only), described


def _code(varied: "Scenario") -> dict[str, Any]:
    """Return what search.json says of the code: margins of another version are no guide."""
    from worldsim.results.controller_code import code_sha256, user_controllers
    from worldsim.results.provenance import provenance

    known, own = provenance(), user_controllers([varied])
    return {
        "the controller's code": [code_sha256(each.name, each.command)[:12] for each in own],
        "the version of qswarm": known["version"],
        "the commit of qswarm": known["commit"],
        "the version of Python": known["python"],
    }


def _base(controller: str | None, base: str | None, settings: list[str] | None) -> "Scenario":
    """Return the scenario that is varied, or one to check the controller with."""
    from worldsim.engine.preflight import VIRTUAL_COMMAND_TICKS

    if settings and base is None:
        raise typer.BadParameter("needs --base: otherwise all keys are drawn", param_hint="--set")
    overrides = overrides_of(settings, None, None, None)
    if controller is not None:
        overrides["control.controller"] = controller
    scenario = load_scenario(base or "wedge-9", overrides, VIRTUAL_COMMAND_TICKS)
    if base is not None:
        warn(base, scenario)
    return scenario


def _guided(wanted: bool | None) -> bool:
    """Return whether odd seeds lower the margin. Raises typer.BadParameter without optuna."""
    from worldsim.search.guide import is_available

    if wanted and not is_available():
        raise typer.BadParameter(
            "needs optuna: pip install 'qswarm[search]'", param_hint="--guided"
        )
    if wanted is None and not is_available():
        complain("qswarm: all seeds are random: optuna is missing (pip install 'qswarm[search]')")
    return is_available() if wanted is None else wanted


@commands.command(epilog=examples("qswarm cause runs/fuzz/findings/I4-13", "qswarm cause ."))
def cause(
    finding: Annotated[
        Path, typer.Argument(metavar="FINDING", help="Folder of a finding of `qswarm fuzz`.")
    ],
    draws: Annotated[
        int, typer.Option(metavar="N", min=2, max=1000, help="Other draws at each tick.")
    ] = 20,
    jobs: FlightsAtOnce = None,
    quiet: Quiet = False,
) -> int:
    """Find the tick from which on a finding's failure was certain.

    The flight is repeated as it was up to a tick; from there on it draws other numbers for radio
    and sensors, no event begins, and no fault ends. Bisection finds the first tick after which
    95 % of such flights fail. It also tells the last event without which nothing fails. Both are
    added to finding.md. Exit status 1: the finding no longer fails.
    """
    from netem.wire.shutdown import stop_requests
    from worldsim.fuzz.cause import find_cause
    from worldsim.fuzz.flights import WORK, Hangar
    from worldsim.results.progress_line import ProgressLine

    line = ProgressLine(hidden=quiet)
    with stop_requests() as stop:
        hangar = Hangar(local_site(jobs, finding / WORK), stop)
        found = find_cause(finding, hangar, draws, line.update)
    line.clear()
    if found is None:
        complain("qswarm: interrupted; the same command begins anew")
        return INTERRUPTED
    print(f"{finding}: {found.text}")
    return PASS if found.replays else FAIL
