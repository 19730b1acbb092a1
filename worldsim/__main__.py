"""The world by hand: ``python -m worldsim SCENARIO --connect tcp/127.0.0.1:7447 --out DIR``."""

import argparse
import os
import sys
from pathlib import Path

from netem.compiled import tell_if_unfit
from netem.wire.keys import Keys
from worldsim.engine.preflight import PROCESS_COMMAND_TICKS, admit
from worldsim.fleet.launcher_link import ManualLink
from worldsim.fleet.process import RunOptions, run
from worldsim.fleet.process_table import ProcessTable
from worldsim.results.environment import prepare_environment
from worldsim.results.run_folder import RunDirectory
from worldsim.scenario.file import load
from worldsim.scenario.library import find_scenario
from worldsim.scenario.tables import Scenario
from worldsim.scenario.toml import ScenarioError

MAX_SPEED = 1000.0

DESCRIPTION = """\
The world of a fleet whose processes are started by hand: it owns the truth, advances time, judges
and records.

It waits until netem and all agents of the scenario are up, runs the scenario, and writes the
recording, the events and the summary into DIR. `qswarm run` does all of this with one command."""

EPILOG = """\
exit status: 0 the expectations are met; 1 they are not; 2 bad input, or a process did not start;
3 inconclusive: the host was too slow, or the run was interrupted"""


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m worldsim",
        description=DESCRIPTION,
        epilog=EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    add = parser.add_argument
    add("scenario", metavar="SCENARIO", help="a scenario file (TOML), or a scenario of the library")
    add("--connect", required=True, metavar="ENDPOINT", help="the router: tcp/127.0.0.1:7447")
    add("--out", required=True, type=Path, metavar="DIR", help="output directory (must not exist)")
    add(
        "--run",
        type=_run_name,
        metavar="NAME",
        help="the run's name (default: the scenario's)",
    )
    add(
        "--speed",
        type=_speed,
        default=1.0,
        metavar="X",
        help="simulated seconds per second (default: 1)",
    )
    add(
        "--on-overload",
        choices=("go", "slow", "abort"),
        default="go",
        help="when ticks are late: go on and report it, slow simulated time down, or abort the run"
        " (default: go)",
    )
    add("--no-recording", action="store_true", help="write no run.rrd")
    return parser


def main(arguments: list[str] | None = None) -> int:
    """Run the world by the command line; return the exit status."""
    options = _parser().parse_args(arguments)
    prepare_environment()
    tell_if_unfit()
    try:
        file = find_scenario(options.scenario)
        scenario = admit(load(file), file, PROCESS_COMMAND_TICKS, "by hand")
    except ScenarioError as error:
        print(f"world: {error}", file=sys.stderr)
        return 2
    return run(
        options.connect,
        scenario,
        lambda: _directory(options, scenario),
        RunOptions(
            options.run or scenario.name,
            options.speed,
            not options.no_recording,
            on_overload=options.on_overload,
        ),
        lambda startup: ManualLink(startup.vanished),
    )


def _directory(options: argparse.Namespace, scenario: Scenario) -> RunDirectory:
    """Create the run's folder, with the endpoint in it. Raises RunDirectoryError."""
    directory = RunDirectory.create(options.out, scenario)
    table = ProcessTable(directory.path, options.run or scenario.name, options.connect)
    table.add("world", os.getpid())
    table.write()
    return directory


def _run_name(text: str) -> str:
    try:
        return Keys(text).run
    except ValueError as error:
        raise argparse.ArgumentTypeError(str(error)) from error


def _speed(text: str) -> float:
    speed = float(text)
    if not 0.0 < speed <= MAX_SPEED:
        raise argparse.ArgumentTypeError(f"{text}; above 0, up to {MAX_SPEED:g} is allowed")
    return speed


if __name__ == "__main__":
    sys.exit(main())
