"""Checks of a scenario before a run starts, beside those of its file.

The start has room for all vehicles, the controller can be loaded, and the safety filter can keep
the vehicles apart under the run's clock.
"""

import shutil
from pathlib import Path
from typing import Final, Literal

import msgspec
from msgspec.structs import replace

from agent.checked_controller import described
from agent.controller import ControllerError
from agent.controller import load as load_controller
from agent.parameters import ParametersError, parameters_type, takes_any, unknown_parameters
from agent.services import ServicesError, services_of
from netem.compiled import UnloadableError
from netem.faults import Outage
from worldsim.scenario.decoding import decode, unknown_key
from worldsim.scenario.faults import Join, ProcessFault, StopWorld
from worldsim.scenario.problem import Problem
from worldsim.scenario.rules import speed_problem
from worldsim.scenario.start import BoxStart
from worldsim.scenario.tables import Scenario
from worldsim.scenario.toml import ScenarioError
from worldsim.truth.obstacles import Obstacles
from worldsim.truth.start_positions import StartError, clearance_of, start_poses, start_poses_of

PARAMETERS: Final = "control.parameters"
VIRTUAL_COMMAND_TICKS: Final = 1
"""Lifetime of a command in virtual time and in lockstep, where none is late [ticks]."""
PROCESS_COMMAND_TICKS: Final = 2
"""Lifetime of a command of free-running processes [ticks]; H of docs/method.md."""


Processes = Literal["launched", "by hand", "none"]
"""How a run's processes are started: by the launcher, by hand, or not at all in virtual time."""


def admit(
    scenario: Scenario, file: str | Path, command_ticks: int, processes: Processes = "none"
) -> Scenario:
    """Return a scenario as it is flown: with all parameters of its controller.

    command_ticks: lifetime of a command under the run's clock. processes: how they are started; by
    hand, events on them cannot be carried out. Raises ScenarioError where the scenario cannot be
    flown.
    """
    problem = (
        speed_problem(scenario, command_ticks)
        or (_launcher(scenario) if processes == "by hand" else None)
        or (foreign_problem(scenario, processes) if processes != "launched" else None)
        or _controller(scenario)
        or _services(scenario)
        or _room(scenario)
        or _joining_room(scenario)
    )
    if problem is not None:
        raise ScenarioError(file, *problem)
    placed = _with_agents_commands(_with_command(scenario, Path(file)), Path(file))
    return _with_parameters(placed, file)


def foreign_problem(scenario: Scenario, processes: Processes) -> Problem | None:
    """Return a problem for the first foreign agent of a run without a launcher."""
    for index, table in enumerate(scenario.agent):
        if table.command is not None:
            reason = (
                "a process of its own cannot fly in virtual time; use qswarm run, with --lockstep"
                " for repeatable runs"
                if processes == "none"
                else "needs the launcher (qswarm run): start this agent by hand, too, and leave the"
                " key out"
            )
            return Problem(f"agent[{index}].command", reason)
    return None


def _launcher(scenario: Scenario) -> Problem | None:
    """Return a problem for the first event that needs a launcher."""
    for index, event in enumerate(scenario.event):
        if isinstance(event.action, ProcessFault | StopWorld | Outage):
            return Problem(
                f"event[{index}].{event.kind}",
                "needs the launcher (qswarm run): processes started by hand are ended by hand",
            )
    return None


def _controller(scenario: Scenario) -> Problem | None:
    name = scenario.control.controller
    try:
        load_controller(name)
    except ControllerError as error:
        return Problem("control.controller", str(error))
    except UnloadableError:
        raise  # not the controller's fault
    except (Exception, SystemExit, GeneratorExit) as error:  # a user's module may raise anything
        return Problem(
            "control.controller",
            f"{name!r} cannot be imported: {described(error)}",
        )
    return None


def _services(scenario: Scenario) -> Problem | None:
    """Return a problem of the services that the controller asks for, or the scenario for it."""
    control = scenario.control
    key = "control.controller" if control.services is None else "control.services"
    try:
        services = services_of(load_controller(control.controller), control.services)
    except (ServicesError, TypeError) as error:
        return Problem(key, f"services of {control.controller!r}: {error}")
    blind = [i for i, each in enumerate(scenario.vehicles) if "proximity" not in each.sensors]
    if not services.beacons and blind and control.safety_filter == "on" and scenario.rows > 1:
        return Problem(
            key,
            f"without the service 'beacons', agent {blind[0]} knows no other vehicle: it has no"
            " proximity sensor, and the safety filter would let it stand; give it the sensor, or"
            ' set control.safety_filter = "off"',
        )
    return None


def _with_parameters(scenario: Scenario, file: str | Path) -> Scenario:
    """Return a scenario with its controller's parameters checked and their defaults filled in."""
    given = scenario.control.parameters
    controller = load_controller(scenario.control.controller)
    try:
        kind = parameters_type(controller)
    except ParametersError as error:
        raise ScenarioError(file, "control.controller", str(error)) from error
    if kind is None:
        if given and not takes_any(controller):
            detail = f"the controller {scenario.control.controller!r} takes no parameters"
            raise ScenarioError(file, PARAMETERS, detail)
        return scenario
    for name in unknown_parameters(kind, given):
        known = [field.encode_name for field in msgspec.structs.fields(kind)]
        raise ScenarioError(file, f"{PARAMETERS}.{name}", unknown_key(name, known))
    plain = msgspec.json.decode(msgspec.json.encode(decode(given, kind, file, PARAMETERS)))
    control = replace(scenario.control, parameters=plain)
    return replace(scenario, control=control)


def _with_command(scenario: Scenario, file: Path) -> Scenario:
    """Return a scenario whose command names a program by its whole path."""
    command = scenario.control.command
    if command is None:
        return scenario
    found = _found_command(command, "control.command", file)
    return replace(scenario, control=replace(scenario.control, command=found))


def _with_agents_commands(scenario: Scenario, file: Path) -> Scenario:
    """Return a scenario whose foreign agents' commands name their programs by their whole paths."""
    tables = tuple(
        table
        if table.command is None
        else replace(table, command=_found_command(table.command, f"agent[{k}].command", file))
        for k, table in enumerate(scenario.agent)
    )
    return replace(scenario, agent=tables)


def _found_command(command: tuple[str, ...], key: str, file: Path) -> tuple[str, ...]:
    """Return a command whose program is named by its whole path.

    A program with a slash in its name, and an argument that names a file, are relative to the
    scenario's folder. Raises ScenarioError where there is no such program, or it is not executable.
    """
    for index, each in enumerate(command):
        if "\0" in each:
            detail = "holds a NUL, which no argument of a program may"
            raise ScenarioError(file, f"{key}[{index}]", detail)
    program, *arguments = command
    beside = str((file.parent / program).absolute())
    found = shutil.which(beside if "/" in program else program)
    if found is None:
        exists = "/" in program and Path(beside).exists()
        detail = f"{program!r} {'is not executable' if exists else 'does not exist'}"
        raise ScenarioError(file, f"{key}[0]", detail)
    placed = [
        str((file.parent / each).absolute()) if (file.parent / each).is_file() else each
        for each in arguments
    ]
    return (found, *placed)


def _room(scenario: Scenario) -> Problem | None:
    try:
        start_poses_of(scenario, Obstacles(scenario.obstacle))
    except StartError as error:
        return Problem("fleet.start", str(error))
    return None


def _joining_room(scenario: Scenario) -> Problem | None:
    """Return a problem for the first join that has no room even in a world without vehicles."""
    obstacles = Obstacles(scenario.obstacle)
    for index, event in enumerate(scenario.event):
        join = event.action
        if not isinstance(join, Join) or not isinstance(join.start, BoxStart):
            continue
        clearance = clearance_of(scenario, obstacles, event.at_s)
        try:
            start_poses(join.start, join.count, scenario.seed, clearance, event=index + 1)
        except StartError as error:
            return Problem(f"event[{index}].join.start", str(error))
    return None
