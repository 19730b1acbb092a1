"""What one agent was given in a run: the frames that it heard and its observations, in order."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

from agent.config import AgentSetup
from agent.messages import Observation
from netem.wire.frame import Frame


class StepInputs(NamedTuple):
    """What the agent was given before and at one step."""

    frames: tuple[Frame, ...]  # heard since the step before
    observation: Observation


@dataclass(frozen=True, slots=True)
class Life:
    """One process of the agent, from its start to its end."""

    setup: AgentSetup
    steps: list[StepInputs] = field(default_factory=list)


class LifeRecorder:
    """Keeps the lives of one agent of a flight in virtual time; see worldsim.engine.virtual."""

    def __init__(self, agent: int) -> None:
        self.agent = agent
        self.lives: list[Life] = []

    def begin(self, setup: AgentSetup) -> None:
        """Note that a process of the agent starts."""
        self.lives.append(Life(setup))

    def step(self, frames: Sequence[Frame], observation: Observation) -> None:
        """Note what the agent is given at a step."""
        self.lives[-1].steps.append(StepInputs(tuple(frames), observation))
