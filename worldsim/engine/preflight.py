"""What a scenario must pass before anything is started, besides its own checks.

A start with room for everybody, a controller that can be had, vehicles that the safety filter can
hold under the clock in question.
"""

from pathlib import Path

from agent.controller import ControllerError
from agent.controller import load as load_controller
from worldsim.scenario.events import ON_PROCESSES
from worldsim.scenario.problem import Problem
from worldsim.scenario.rules import speed_problem
from worldsim.scenario.tables import Scenario
from worldsim.scenario.toml import ScenarioError
from worldsim.truth.obstacles import Obstacles
from worldsim.truth.start_positions import StartError, start_poses_of

VIRTUAL_COMMAND_TICKS = 1
"""Life of a command in virtual time and in lockstep, where none is late [ticks]."""
PROCESS_COMMAND_TICKS = 2
"""Life of a command in free-running processes [ticks]; H of docs/method.md follows from it."""


def admit(scenario: Scenario, file: str | Path, command_ticks: int, by_hand: bool = False) -> None:
    """Raise ScenarioError if a scenario cannot be flown where a command lives that long.

    by_hand: whether every process is started by hand, so that none can be stopped by a timeline.
    """
    broken = (
        speed_problem(scenario, command_ticks)
        or (_launcher(scenario) if by_hand else None)
        or _controller(scenario)
        or _room(scenario)
    )
    if broken is not None:
        raise ScenarioError(file, *broken)


def _launcher(scenario: Scenario) -> Problem | None:
    """Say which event needs somebody who starts and ends processes."""
    for index, event in enumerate(scenario.event):
        if event.kind in ON_PROCESSES:
            return Problem(
                f"event[{index}].{event.kind}",
                "needs the launcher (qswarm run): who is started by hand is ended by hand",
            )
    return None


def _controller(scenario: Scenario) -> Problem | None:
    name = scenario.control.controller
    try:
        load_controller(name)
    except ControllerError as error:
        return Problem("control.controller", str(error))
    except Exception as error:  # the user's module may raise anything while it is imported
        return Problem(
            "control.controller", f"{name!r} cannot be imported: {type(error).__name__}: {error}"
        )
    return None


def _room(scenario: Scenario) -> Problem | None:
    try:
        start_poses_of(scenario, Obstacles(scenario.obstacle))
    except StartError as error:
        return Problem("fleet.start", str(error))
    return None
