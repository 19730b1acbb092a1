"""One step of an agent: frames and one observation in, one command and one transmission out."""

from agent.codec import encode
from agent.config import AgentSetup
from agent.core import Agent
from agent.messages import Observation
from netem.wire.bus import Put
from netem.wire.frame import Batch, Outgoing, Transmission, pack


class Controls:
    """A core, and where what it decides goes."""

    def __init__(self, setup: AgentSetup, command: Put, radio: Put) -> None:
        self.core = Agent(setup)
        self._incarnation = setup.incarnation
        self._command = command
        self._radio = radio

    def hear(self, batch: Batch, now_s: float) -> None:
        """Take the frames of a batch."""
        for frame in batch.frames:
            self.core.receive(frame.source, frame.channel, frame.payload, now_s)

    def step(self, observation: Observation) -> None:
        """Step on an observation: say one command and one transmission."""
        outbox = self.core.step(observation)
        self._command(encode(outbox.command))
        frames = tuple(
            Outgoing(channel=channel, payload=payload) for channel, payload in outbox.frames
        )
        sent = Transmission(slot=observation.slot, incarnation=self._incarnation, frames=frames)
        self._radio(pack(sent))
