"""The command line, `qswarm COMMAND`: run, sim, new, check, netem, fault, mission, verify, bench...

Commands check everything before they start anything. Bad input is one line on stderr and exit
status 2; what a command needs is imported inside it, so that --help and check stay quick.
"""

import gc
import os
import sys
import traceback
from collections.abc import Mapping
from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from typer.main import get_command

from worldsim.commands.bench import bench
from worldsim.commands.netem import netem
from worldsim.commands.operate import attach
from worldsim.commands.options import (
    Agents,
    Duration,
    Gallery,
    Lockstep,
    NoRecording,
    Out,
    RunFolder,
    ScenarioFile,
    ScenarioFiles,
    Schema,
    Seed,
    Settings,
    Shards,
    check_lockstep,
    examples,
    overrides_of,
    seeds_of,
)

if TYPE_CHECKING:
    from worldsim.scenario.tables import Scenario

HELD, NOT_HELD, BAD_INPUT, INTERRUPTED = 0, 1, 2, 130


app = typer.Typer(
    name="qswarm",
    help="Chaos testing for swarm controllers: a fleet of real processes or the same fleet in"
    " virtual time, an emulated radio between the agents, and a verdict.",
    epilog=examples(
        "qswarm run deploy/scenarios/wedge-9.toml",
        "qswarm sim deploy/scenarios/wedge-9.toml --seeds 0:20",
        "qswarm COMMAND --help",
    )
    + "\n\nExit status: 0 the expectations held; 1 they did not; 2 bad input, nothing started;"
    " 3 inconclusive, the host was too slow or the fleet lost its radio;"
    " 130 interrupted.",
    add_completion=False,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
)


@app.command(
    epilog=examples(
        "qswarm run deploy/scenarios/wedge-9.toml",
        "qswarm run deploy/scenarios/wedge-9.toml --seed 7 --set netem.loss_percent=50",
        "qswarm run deploy/scenarios/wedge-9.toml --agents 20 --duration 40 --speed 2",
        "qswarm run deploy/scenarios/wedge-9.toml --lockstep",
        "qswarm run --list",
    )
)
def run(
    scenario: ScenarioFile,
    agents: Agents = None,
    seed: Seed = None,
    speed: Annotated[
        float, typer.Option(metavar="X", help="Simulated seconds in one of the clock.", min=0.01)
    ] = 1.0,
    lockstep: Lockstep = False,
    shards: Shards = 1,
    duration: Duration = None,
    settings: Settings = None,
    out: Out = None,
    no_recording: NoRecording = False,
    gallery: Gallery = False,
) -> int:
    """Fly a fleet of real processes: netem, world and one for each agent, over Zenoh."""
    from worldsim.engine.preflight import PROCESS_COMMAND_TICKS, VIRTUAL_COMMAND_TICKS
    from worldsim.fleet.launcher import run as fly_processes
    from worldsim.fleet.process import Terms
    from worldsim.results.run_folder import RunDirectory

    if not isfinite(speed):
        raise typer.BadParameter(f"{speed}; a number from 0.01", param_hint="--speed")
    check_lockstep(lockstep, speed, shards)
    overrides = overrides_of(settings, agents, seed, duration)
    command_ticks = VIRTUAL_COMMAND_TICKS if lockstep else PROCESS_COMMAND_TICKS
    admitted = _admitted(scenario, overrides, command_ticks)
    directory = RunDirectory.create(out, admitted)
    terms = Terms(admitted.name, speed, not no_recording, lockstep, shards)
    return fly_processes(admitted, directory, terms)


@app.command(
    epilog=examples(
        "qswarm sim deploy/scenarios/wedge-9.toml",
        "qswarm sim deploy/scenarios/wedge-9.toml --seeds 0:20 --jobs 2 --out runs/twenty",
        "qswarm sim deploy/scenarios/wedge-9.toml --set netem.delay_ms=200 --no-recording",
    )
)
def sim(
    scenarios: ScenarioFiles,
    agents: Agents = None,
    seed: Seed = None,
    seeds: Annotated[
        str | None,
        typer.Option(metavar="A:B", help="Fly each seed from A up to, not with, B."),
    ] = None,
    jobs: Annotated[
        int | None, typer.Option(metavar="N", min=1, help="Processes at work at once. [all cores]")
    ] = None,
    duration: Duration = None,
    settings: Settings = None,
    out: Out = None,
    no_recording: NoRecording = False,
    gallery: Gallery = False,
) -> int:
    """Fly the same fleet in virtual time, in one process, as fast as the host allows."""
    from worldsim.campaign.virtual_runs import simulate_many, simulate_one
    from worldsim.engine.preflight import VIRTUAL_COMMAND_TICKS

    if seed is not None and seeds is not None:
        raise typer.BadParameter("not beside --seed; one or the other", param_hint="--seeds")
    flown = [
        _admitted(file, overrides_of(settings, agents, each, duration), VIRTUAL_COMMAND_TICKS)
        for file in scenarios
        for each in (seeds_of(seeds) if seeds is not None else (seed,))
    ]
    if seeds is None and len(scenarios) == 1:
        return simulate_one(flown[0], out, not no_recording)
    return simulate_many(flown, out, not no_recording, jobs or len(os.sched_getaffinity(0)))


@app.command(epilog=examples("qswarm new my-wedge", "qswarm sim my-wedge.toml"))
def new(
    name: Annotated[str, typer.Argument(metavar="NAME", help="The scenario's name.")],
) -> int:
    """Write NAME.toml, a scenario to start from: every key, with what is allowed there."""
    from worldsim.scenario.template import write

    file = write(name)
    print(f"{file}: written; to fly it: qswarm sim {file}")
    return HELD


@app.command(
    epilog=examples(
        "qswarm check deploy/scenarios/wedge-9.toml",
        "qswarm check my.toml --agents 50 --set fleet.tick_hz=40 > resolved.toml",
        "qswarm check --schema > scenario.schema.json",
    )
)
def check(
    scenario: ScenarioFile,
    agents: Agents = None,
    seed: Seed = None,
    duration: Duration = None,
    settings: Settings = None,
    schema: Schema = False,
) -> int:
    """Check a scenario and print it resolved; warnings go to stderr. Nothing is started."""
    from worldsim.engine.preflight import PROCESS_COMMAND_TICKS, VIRTUAL_COMMAND_TICKS
    from worldsim.scenario.file import dump
    from worldsim.scenario.rules import cautions, too_fast

    overrides = overrides_of(settings, agents, seed, duration)
    admitted = _admitted(scenario, overrides, VIRTUAL_COMMAND_TICKS)
    for caution in cautions(admitted):
        _say(f"{scenario}: {caution.key}: warning: {caution.detail}")
    outrun = too_fast(admitted, PROCESS_COMMAND_TICKS)
    if outrun is not None:
        _say(f"{scenario}: {outrun.key}: warning: only 'sim' can fly this: {outrun.detail}")
    sys.stdout.write(dump(admitted))
    return HELD


@app.command(epilog=examples("qswarm verify runs/wedge-9-20260102T030405Z"))
def verify(run: RunFolder) -> int:
    """Judge a run again from its recording alone, and compare with its summary."""
    from worldsim.recording.verify import verify as verify_run
    from worldsim.results.verdict_text import verified

    verification = verify_run(run)
    if verification.problem is not None:
        _say(verification.problem)
    else:
        print(verified(verification))
    return verification.exit_status


@app.command(
    epilog=examples("qswarm view runs/wedge-9-20260102T030405Z", "qswarm view runs/twenty --web")
)
def view(
    runs: Annotated[
        list[Path],
        typer.Argument(metavar="RUN", help="Folders of runs, of many runs, or recordings."),
    ],
    web: Annotated[
        bool, typer.Option("--web", help="Serve a browser on this machine, instead of a window.")
    ] = False,
) -> int:
    """Open recordings in the rerun viewer, several together."""
    from worldsim.recording.viewer import recordings
    from worldsim.recording.viewer import view as show

    return HELD if show(recordings(runs), web) == 0 else NOT_HELD


app.command(
    epilog=examples(
        "qswarm netem check deploy/scenarios/bursty-9.toml",
        "qswarm netem check my.toml --set netem.loss_percent=50 --plot radio.png",
        "qswarm netem runs/mine set loss_percent=50 multihop.delay_ms=200 --for 10",
        "qswarm netem runs/mine partition 0,1/2,3",
        "qswarm netem runs/mine partition groups=[[0,1]] kind=one_way --for 5",
        "qswarm netem runs/mine jam centre_m=[0,0,0] radius_m=2",
        "qswarm netem runs/mine show",
    )
)(netem)


app.command(epilog=examples("qswarm bench", "qswarm bench --repeats 5 --json speed.json"))(bench)


@app.command(epilog=examples("qswarm ps runs/wedge-9-20260102T030405Z"))
def ps(run: RunFolder) -> int:
    """List the processes of a fleet: name, pid, and whether it is alive."""
    from worldsim.fleet.launcher import processes

    for name, pid, alive in processes(run):
        print(f"{name:12} {pid:>8}  {'alive' if alive else 'gone'}")
    return HELD


attach(app)


def main() -> None:
    """Run the command line and exit with the contract's status."""
    # Little that a fleet makes holds a cycle: the collector may look more rarely.
    gc.set_threshold(200_000)
    # A controller of the user's own is looked for last where the command is given.
    sys.path.append(str(Path.cwd()))
    try:
        status = command(sys.argv[1:])
    except KeyboardInterrupt:
        status = _interrupted()
    sys.exit(status)


def command(arguments: list[str]) -> int:
    """Run one command line; return its exit status. Bad input is told in one line."""
    from agent.checked_controller import FaultyControllerError
    from worldsim.fleet.process_table import OperatorError
    from worldsim.recording.viewer import ViewerError
    from worldsim.results.run_folder import RunDirectoryError, RunWriteError
    from worldsim.scenario.toml import ScenarioError

    try:
        status = get_command(app)(arguments, prog_name="qswarm", standalone_mode=False)
    except (ScenarioError, RunDirectoryError, ViewerError, OperatorError) as error:
        _say(str(error))
        return NOT_HELD if isinstance(error, RunWriteError) else BAD_INPUT
    except typer.TyperException as error:
        _say(f"qswarm: {' '.join(error.format_message().split())} (see qswarm --help)")
        return BAD_INPUT
    except FaultyControllerError as error:
        traceback.print_exception(error.__cause__)
        _say(f"qswarm: {error}")
        return NOT_HELD
    except (typer.Abort, KeyboardInterrupt):
        return _interrupted()
    return int(status or HELD)


def _interrupted() -> int:
    _say("qswarm: interrupted")
    return INTERRUPTED


def _admitted(file: Path, overrides: Mapping[str, str], command_ticks: int) -> "Scenario":
    from worldsim.engine.preflight import admit
    from worldsim.scenario.file import load

    scenario = load(file, overrides)
    admit(scenario, file, command_ticks)
    return scenario


def _say(line: str) -> None:
    print(line, file=sys.stderr)
