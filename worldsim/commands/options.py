"""What commands share: arguments and options, the scenario they name, messages on stderr."""

import re
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

if TYPE_CHECKING:
    from worldsim.engine.preflight import Processes
    from worldsim.live.live_view import LiveView
    from worldsim.scenario.tables import Scenario

MAX_RUNS = 1_000_000


def examples(*lines: str) -> str:
    """Return example command lines as the end of a command's help."""
    return "\n".join(("\b", "Examples:", *(f"  {line}" for line in lines)))


def complain(line: str) -> None:
    """Print an error or a warning on stderr."""
    print(line, file=sys.stderr)


def _print_library(requested: bool) -> None:
    if requested:
        from worldsim.scenario.library import scenarios

        entries = scenarios()
        width = max(len(entry.name) for entry in entries)
        for entry in entries:
            print(f"{entry.name:{width}}  {entry.shows}")
        raise typer.Exit


def _print_schema(requested: bool) -> None:
    if requested:
        import json

        from worldsim.scenario.schema import schema

        print(json.dumps(schema(), indent=2))
        raise typer.Exit


def _print_line_schema(requested: bool) -> None:
    if requested:
        import json

        from agent.lines import line_schema

        print(json.dumps(line_schema(), indent=2))
        raise typer.Exit


ScenarioFile = Annotated[
    str,
    typer.Argument(
        metavar="SCENARIO", help="A scenario file (TOML), or a scenario of the library."
    ),
]
ScenarioFiles = Annotated[
    list[str],
    typer.Argument(metavar="SCENARIO", help="Scenario files (TOML), or scenarios of the library."),
]
List = Annotated[
    bool,
    typer.Option(
        "--list",
        is_eager=True,
        callback=_print_library,
        help="List the scenarios of the library and exit.",
    ),
]
Schema = Annotated[
    bool,
    typer.Option(
        "--schema",
        is_eager=True,
        callback=_print_schema,
        help="Print the JSON Schema of scenario files and exit.",
    ),
]
LineSchema = Annotated[
    bool,
    typer.Option(
        "--line-schema",
        is_eager=True,
        callback=_print_line_schema,
        help="Print the JSON Schema of the lines of [control] command and exit.",
    ),
]
Recordings = Annotated[
    list[Path],
    typer.Argument(metavar="RUN", help="Run directories, directories of many runs, or recordings."),
]
RunFolder = Annotated[Path, typer.Argument(metavar="RUN", help="The output directory of a run.")]
Agents = Annotated[
    int | None, typer.Option(metavar="N", help="Number of agents (instead of the scenario's).")
]
Seed = Annotated[
    int | None,
    typer.Option(metavar="S", help="Seed of starts and radio (instead of the scenario's)."),
]
_SEEDS: Any = typer.Option(metavar="A:B", help="Fly each seed from A up to, but not including, B.")
Seeds = Annotated[str, _SEEDS]
SeedsIfAny = Annotated[str | None, _SEEDS]
Duration = Annotated[
    float | None,
    typer.Option(metavar="T", help="Simulated seconds (instead of the scenario's)."),
]
Settings = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="KEY=VALUE", help="Set any key of the scenario; repeatable."),
]
Lockstep = Annotated[
    bool,
    typer.Option(
        "--lockstep",
        help="Synchronous: simulated time waits for every process; repeatable on any host.",
    ),
]
OnOverload = Annotated[
    Literal["go", "slow", "abort"],
    typer.Option(
        help="When ticks are late: go on and report it, slow simulated time down, or abort the run."
    ),
]
Shards = Annotated[
    int,
    typer.Option(metavar="N", min=1, max=64, help="Number of radio processes (needs --lockstep)."),
]
Out = Annotated[
    Path | None,
    typer.Option(
        metavar="DIR",
        help="Output directory (must not exist).",
        show_default="runs/SCENARIO-TIME",
    ),
]
NoRecording = Annotated[
    bool, typer.Option("--no-recording", help="Do not write the recording, run.rrd.")
]
Live = Annotated[
    bool,
    typer.Option("--live", help="Show the run in a window of the rerun viewer while it flies."),
]
LiveWeb = Annotated[
    bool,
    typer.Option(
        "--live-web",
        help="Show it in a browser on this host; prints the address, and one for viewers.",
    ),
]
RecordInputs = Annotated[
    bool,
    typer.Option(
        "--record-inputs",
        help="Keep all that each agent is given, for `qswarm replay`; in lockstep and virtual time"
        " it can be made again.",
    ),
]
Verify = Annotated[
    bool,
    typer.Option(
        "--verify",
        help="Fly twice and compare the traces; exit 1 with tick and agent where they part.",
    ),
]
Quiet = Annotated[
    bool, typer.Option("--quiet", help="Print the outcome and errors only, no progress.")
]
Json = Annotated[
    bool,
    typer.Option(
        "--json",
        help="Print the summary on stdout as one JSON document; everything else goes to stderr.",
    ),
]

JUnit = Annotated[
    Path | None,
    typer.Option(
        "--junit",
        metavar="FILE",
        help="Write a JUnit file for CI: a case for each expectation and invariant.",
    ),
]


def load_scenario(
    given: str, overrides: Mapping[str, str], command_ticks: int, processes: "Processes" = "none"
) -> "Scenario":
    """Return a scenario, given by path or name, that may run where a command lives so long [ticks].

    processes: how they are started. Raises ScenarioError.
    """
    from worldsim.engine.preflight import admit
    from worldsim.fleet.import_probe import import_problem
    from worldsim.scenario.file import load
    from worldsim.scenario.library import find_scenario
    from worldsim.scenario.toml import ScenarioError

    file = find_scenario(given)
    scenario = load(file, overrides)
    problem = import_problem(scenario.control.controller)
    if problem is not None:
        name = scenario.control.controller
        raise ScenarioError(file, "control.controller", f"{name!r}: {problem}")
    return admit(scenario, file, command_ticks, processes)


def warn(given: str, scenario: "Scenario") -> None:
    """Print what a scenario is allowed to ask for but should not."""
    from worldsim.scenario.rules import warnings_for

    for caution in warnings_for(scenario):
        complain(f"{given}: {caution.key}: warning: {caution.detail}")


def overrides_of(
    settings: list[str] | None, agents: int | None, seed: int | None, duration: float | None
) -> dict[str, str]:
    """Return the overridden keys; --agents, --seed and --duration win over --set.

    Raises typer.BadParameter for a setting that is not KEY=VALUE.
    """
    overrides = {}
    for setting in settings or []:
        key, equals, value = setting.partition("=")
        if not equals or not key.strip():
            raise typer.BadParameter(
                f"{setting!r}; write it as netem.loss_percent=50", param_hint="--set"
            )
        overrides[key.strip()] = value.strip()
    options = {"fleet.agents": agents, "seed": seed, "duration_s": duration}
    return overrides | {key: str(value) for key, value in options.items() if value is not None}


def check_lockstep(lockstep: bool, speed: float, shards: int, on_overload: str) -> None:
    """Raise typer.BadParameter for options that --lockstep excludes, or that need it."""
    if lockstep and speed != 1.0:
        raise typer.BadParameter(
            "cannot be combined with --lockstep, which has no fixed speed", param_hint="--speed"
        )
    if lockstep and on_overload != "go":
        raise typer.BadParameter(
            "cannot be combined with --lockstep, in which no tick is late",
            param_hint="--on-overload",
        )
    if shards > 1 and not lockstep:
        raise typer.BadParameter("needs --lockstep", param_hint="--shards")


def live_view_of(window: bool, browser: bool, no_recording: bool, runs: int = 1) -> "LiveView":
    """Return where a run is shown while it flies.

    Raises typer.BadParameter without a recording to show, or for several runs, and ViewerError
    without a viewer.
    """
    from worldsim.live.live_view import LiveView

    live = LiveView(window, browser)
    option = "--live" if window else "--live-web"
    if live.wanted and no_recording:
        raise typer.BadParameter("needs the recording", param_hint=option)
    if live.wanted and runs > 1:
        raise typer.BadParameter("shows one run, and these are many", param_hint=option)
    live.check()
    return live


def seeds_of(text: str) -> range:
    """Return the seeds of a text such as 0:20, the end excluded. Raises typer.BadParameter."""
    parts = re.fullmatch(r"(\d{1,15}):(\d{1,15})", text)
    seeds = range(int(parts[1]), int(parts[2])) if parts else range(0)
    if not seeds or len(seeds) > MAX_RUNS:
        raise typer.BadParameter(
            f"{text!r}; write first:end, as 0:20 for 0 to 19, at most {MAX_RUNS} seeds",
            param_hint="--seeds",
        )
    return seeds
