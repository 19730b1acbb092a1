"""The commands about scenario files: ``new`` writes one, ``check`` validates one."""

import sys
from typing import Annotated

import typer

from worldsim.commands.options import (
    Agents,
    Duration,
    LineSchema,
    ScenarioFile,
    Schema,
    Seed,
    Settings,
    complain,
    examples,
    load_scenario,
    overrides_of,
    warn,
)
from worldsim.results.exit_status import PASS

commands = typer.Typer()


@commands.command(epilog=examples("qswarm new my-wedge", "qswarm sim my-wedge.toml"))
def new(
    name: Annotated[str, typer.Argument(metavar="NAME", help="Name of the new scenario.")],
) -> int:
    """Write NAME.toml, a scenario to start from.

    It holds the tables and their keys with defaults and allowed values, and it runs as it is.
    """
    from worldsim.scenario.template import write

    file = write(name)
    print(f"{file}: written; run it with: qswarm sim {file}")
    return PASS


@commands.command(
    epilog=examples(
        "qswarm check wedge-9",
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
    line_schema: LineSchema = False,
) -> int:
    """Validate a scenario and print it with all defaults.

    Warnings go to stderr. Nothing is started.
    """
    from worldsim.engine.preflight import (
        PROCESS_COMMAND_TICKS,
        VIRTUAL_COMMAND_TICKS,
        foreign_problem,
    )
    from worldsim.engine.start_reach import start_warnings
    from worldsim.scenario.file import dump
    from worldsim.scenario.rules import speed_problem

    overrides = overrides_of(settings, agents, seed, duration)
    loaded = load_scenario(scenario, overrides, VIRTUAL_COMMAND_TICKS, "launched")
    warn(scenario, loaded)
    for caution in start_warnings(loaded):
        complain(f"{scenario}: {caution.key}: warning: {caution.detail}")
    outrun = speed_problem(loaded, PROCESS_COMMAND_TICKS)
    if outrun is not None:
        complain(f"{scenario}: {outrun.key}: warning: 'qswarm run' rejects this: {outrun.detail}")
    foreign = foreign_problem(loaded, "none")
    if foreign is not None:
        complain(f"{scenario}: {foreign.key}: warning: 'qswarm sim' rejects this: {foreign.detail}")
    sys.stdout.write(dump(loaded))
    return PASS
