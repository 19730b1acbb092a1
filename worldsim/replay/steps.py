"""The steps of a replay: an agent given its inputs again, and what its controller makes of them.

The whole agent runs, so that the controller gets the senses that it had in the run. Only the steps
of a span of time are shown; those before it are needed, for a controller may remember them.
"""

from collections.abc import Callable, Iterator, Sequence
from typing import NamedTuple

from agent.controller import Controller, Intent, Senses
from agent.core import Agent
from agent.input_log import Life
from agent.messages import Vector
from worldsim.replay.decisions import DecisionComparison

Ask = Callable[[Controller, Senses], Intent]


class Span(NamedTuple):
    """A span of simulated time [s], its ends included."""

    from_s: float
    to_s: float

    def holds(self, time_s: float) -> bool:
        """Return whether a time is in the span, but for rounding."""
        return self.from_s - 1e-9 <= time_s <= self.to_s + 1e-9


class Step(NamedTuple):
    """One step of the agent."""

    incarnation: int
    senses: Senses
    intent: Intent
    velocity: Vector  # that it commanded, the safety filter applied [m/s; world frame]
    log: tuple[str, ...]


def steps(
    lives: Sequence[Life],
    span: Span,
    ask: Ask | None = None,
    compared: DecisionComparison | None = None,
) -> Iterator[Step]:
    """Yield the steps of a span. ask: how the controller is asked in it; None: directly.

    compared: gets all steps up to the span's end. Raises FaultyControllerError where the controller
    fails.
    """
    compared = DecisionComparison() if compared is None else compared
    for life in lives:
        if life.steps and life.steps[0].observation.time_s <= span.to_s:
            yield from _steps_of(life, span, ask, compared)


def _steps_of(
    life: Life, span: Span, ask: Ask | None, compared: DecisionComparison
) -> Iterator[Step]:
    asked: list[tuple[Senses, Intent]] = []

    def decide(controller: Controller, senses: Senses) -> Intent:
        shown = span.holds(senses.now_s)
        intent = ask(controller, senses) if shown and ask else controller.decide(senses)
        if shown:
            asked.append((senses, intent))
        return intent

    agent = Agent(life.setup, decide=decide)
    for frames, observation, answered in life.steps:
        if observation.time_s > span.to_s + 1e-9:
            return
        for frame in frames:
            agent.receive(frame.source, frame.channel, frame.payload, observation.time_s)
        command = agent.step(observation).command
        compared.note(observation.time_s, answered, command)
        while asked:
            senses, intent = asked.pop()
            report = command.telemetry.report
            log = report.log if report is not None else ()
            yield Step(life.setup.incarnation, senses, intent, command.velocity, log)
