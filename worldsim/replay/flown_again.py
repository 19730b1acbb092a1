"""A run in virtual time or in lockstep, flown again to learn what one agent was given.

Its inputs need not be recorded: the same scenario, seed and code make them again. The trace tells
whether they did.
"""

from collections.abc import Callable
from typing import NamedTuple

from agent.controller import FaultyControllerError
from agent.input_log import Life
from worldsim.engine.virtual import VirtualFleet
from worldsim.replay.inputs import LifeRecorder
from worldsim.scenario.tables import Scenario


class FlownAgain(NamedTuple):
    """The inputs of an agent, and the trace of the flight that made them."""

    lives: list[Life]
    trace_sha256: str
    failure: str | None  # of a controller, which ended it


def flown_again(
    scenario: Scenario, agent: int, on_progress: Callable[[float], None] = lambda _: None
) -> FlownAgain:
    """Fly a scenario again in virtual time; ``on_progress`` takes the simulated time so far [s]."""
    recorder = LifeRecorder(agent)
    fleet = VirtualFleet(scenario, tap=recorder)
    world = fleet.loop.world
    failure = None
    while world.slot < scenario.slots and fleet.ended_by is None and failure is None:
        try:
            fleet.slot()
        except FaultyControllerError as error:
            failure = str(error)
        on_progress(world.time_s)
    return FlownAgain(recorder.lives, fleet.loop.trace.sha256, failure)
