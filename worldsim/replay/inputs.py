"""What one agent is given in a flight in virtual time, as its processes would keep it."""

from collections.abc import Sequence

from agent.config import AgentSetup
from agent.input_log import Life, StepInputs
from agent.messages import Observation
from netem.wire.frame import Frame


class LifeRecorder:
    """Keeps the lives of one agent of a flight; see worldsim.engine.virtual."""

    def __init__(self, agent: int) -> None:
        self.agent = agent
        self.lives: list[Life] = []

    def begin(self, setup: AgentSetup) -> None:
        """Note that a process of the agent starts."""
        self.lives.append(Life(setup, []))

    def step(self, frames: Sequence[Frame], observation: Observation) -> None:
        """Note what the agent is given at a step."""
        self.lives[-1].steps.append(StepInputs(tuple(frames), observation))
