"""The commands that run scenarios: ``run`` with processes, ``sim`` in virtual time."""

from math import isfinite
from typing import Annotated

import typer

from worldsim.commands.options import (
    Agents,
    Duration,
    Json,
    JUnit,
    List,
    Live,
    LiveWeb,
    Lockstep,
    NoRecording,
    OnOverload,
    Out,
    Quiet,
    RecordInputs,
    ScenarioFile,
    ScenarioFiles,
    Seed,
    SeedsIfAny,
    Settings,
    Shards,
    Verify,
    check_lockstep,
    examples,
    live_view_of,
    load_scenario,
    overrides_of,
    seeds_of,
    warn,
)
from worldsim.commands.sites import FlightsAtOnce, workers_of

commands = typer.Typer()


@commands.command(
    epilog=examples(
        "qswarm run wedge-9",
        "qswarm run wedge-9 --seed 7 --set netem.loss_percent=50",
        "qswarm run my.toml --agents 20 --duration 40 --speed 2",
        "qswarm run wedge-9 --agents 80 --on-overload slow",
        "qswarm run wedge-9 --lockstep --verify",
        "qswarm run wedge-9 --live",
        "qswarm run wedge-9 --json | jq .outcome",
        "qswarm run --list",
    )
)
def run(
    scenario: ScenarioFile,
    agents: Agents = None,
    seed: Seed = None,
    speed: Annotated[
        float,
        typer.Option(metavar="X", help="Simulated seconds in a second of wall time.", min=0.01),
    ] = 1.0,
    on_overload: OnOverload = "go",
    lockstep: Lockstep = False,
    shards: Shards = 1,
    duration: Duration = None,
    settings: Settings = None,
    out: Out = None,
    no_recording: NoRecording = False,
    verify: Verify = False,
    record_inputs: RecordInputs = False,
    live: Live = False,
    live_web: LiveWeb = False,
    quiet: Quiet = False,
    json: Json = False,
    junit: JUnit = None,
    listing: List = False,
) -> int:
    """Run a scenario with real processes that talk over Zenoh.

    The processes are the emulated radio (netem), the world, and one for each agent.
    """
    from worldsim.engine.preflight import PROCESS_COMMAND_TICKS, VIRTUAL_COMMAND_TICKS
    from worldsim.fleet.flown_twice import run_twice
    from worldsim.fleet.launcher import run as run_once
    from worldsim.fleet.process import RunOptions
    from worldsim.results.closing import Output
    from worldsim.results.run_folder import RunDirectory

    if not isfinite(speed):
        raise typer.BadParameter(f"{speed}; a number from 0.01", param_hint="--speed")
    check_lockstep(lockstep, speed, shards, on_overload)
    if verify and not lockstep:
        raise typer.BadParameter(
            "needs --lockstep: free-running runs differ slightly", param_hint="--verify"
        )
    overrides = overrides_of(settings, agents, seed, duration)
    command_ticks = VIRTUAL_COMMAND_TICKS if lockstep else PROCESS_COMMAND_TICKS
    loaded = load_scenario(scenario, overrides, command_ticks, "launched")
    warn(scenario, loaded)
    output = Output(quiet, json, junit)
    output.check(out)
    shown = live_view_of(live, live_web, no_recording)
    directory = RunDirectory.create(out, loaded)
    terms = RunOptions(
        loaded.name,
        speed,
        not no_recording,
        lockstep,
        shards,
        on_overload=on_overload,
        inputs=record_inputs,
    )
    fly = run_twice if verify else run_once
    return shown.watch(directory.recording, lambda: fly(loaded, directory, terms, output))


@commands.command(
    epilog=examples(
        "qswarm sim wedge-9",
        "qswarm sim wedge-9 --seeds 0:20 --jobs 2 --out runs/twenty",
        "qswarm sim my.toml --set netem.delay_ms=200 --no-recording",
        "qswarm sim wedge-100 --live-web",
        "qswarm sim my.toml --verify    # is it the same twice?",
        "qswarm sim wedge-9 --json | jq .min_separation_m",
        "qswarm sim wedge-9 --seeds 0:20 --quiet --junit wedge-9.xml",
    )
)
def sim(
    scenarios: ScenarioFiles,
    agents: Agents = None,
    seed: Seed = None,
    seeds: SeedsIfAny = None,
    jobs: FlightsAtOnce = None,
    duration: Duration = None,
    settings: Settings = None,
    out: Out = None,
    no_recording: NoRecording = False,
    verify: Verify = False,
    live: Live = False,
    live_web: LiveWeb = False,
    quiet: Quiet = False,
    json: Json = False,
    junit: JUnit = None,
    listing: List = False,
) -> int:
    """Run scenarios in virtual time, as fast as the host allows.

    The same agents, radio and world as in `qswarm run`, in one process; the result is repeatable.
    """
    from worldsim.campaign.virtual_runs import simulate_many, simulate_one, simulate_twice
    from worldsim.engine.preflight import VIRTUAL_COMMAND_TICKS
    from worldsim.recording.layout import RECORDING_FILE
    from worldsim.results.closing import Output
    from worldsim.results.run_folder import folder_named_after_now

    if seed is not None and seeds is not None:
        raise typer.BadParameter("cannot be combined with --seed", param_hint="--seeds")
    if verify and (seeds is not None or len(scenarios) > 1):
        raise typer.BadParameter("verifies one run, and these are many", param_hint="--verify")
    loaded = []
    for given in scenarios:
        for each in seeds_of(seeds) if seeds is not None else (seed,):
            overrides = overrides_of(settings, agents, each, duration)
            loaded.append(load_scenario(given, overrides, VIRTUAL_COMMAND_TICKS))
        warn(given, loaded[-1])
    output = Output(quiet, json, junit)
    output.check(out)
    shown = live_view_of(live, live_web, no_recording, len(loaded))
    if seeds is None and len(scenarios) == 1:
        folder = out or folder_named_after_now(loaded[0].name)
        fly = simulate_twice if verify else simulate_one
        return shown.watch(
            folder / RECORDING_FILE,
            lambda: fly(loaded[0], folder, not no_recording, output),
        )
    return simulate_many(loaded, out, not no_recording, workers_of(jobs), output)
