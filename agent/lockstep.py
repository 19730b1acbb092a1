"""The lockstep shell of an agent: it steps on the inbox of each slot, observation included.

A message that cannot be decoded ends the run.
"""

from agent.codec import decode_observation
from agent.config import AgentSetup
from agent.messages import Observation
from agent.rejection import RejectedError
from agent.stepping import AgentStepper, StepNotes
from netem.wire.barrier import LOCKSTEP_RING, LockstepError, check_slot
from netem.wire.bus import Bus
from netem.wire.frame import Batch, Inbox, WireError, unpack_batch, unpack_inbox


class LockstepAgent:
    """An agent in lockstep."""

    def __init__(self, bus: Bus, setup: AgentSetup, notes: StepNotes | None = None) -> None:
        self.inputs = bus.subscriber("rx", setup.id, LOCKSTEP_RING)
        """Each makes the agent step: an inbox."""
        command = bus.publisher("command", setup.id, lockstep=True)
        radio = bus.publisher("tx", setup.id, lockstep=True)
        self._stepper = AgentStepper(setup, command, radio, notes)

    def observe(self, data: bytes) -> None:
        """Step on an encoded inbox. Raises LockstepError if it, or a part of it, is malformed."""
        inbox = _inbox(data)
        name = f"the inbox of slot {inbox.slot}"
        observation = _observation(name, inbox.observation)
        check_slot(f"the observation in {name}", observation.slot, inbox.slot)
        for batch in inbox.batches:
            self._stepper.receive(_batch(name, batch), observation.time_s)
        self._stepper.step(observation)

    def report(self) -> None:
        """Report nothing: in lockstep no frame is late."""


def _inbox(data: bytes) -> Inbox:
    try:
        return unpack_inbox(data)
    except WireError as error:
        raise LockstepError(f"an inbox: {error}") from error


def _observation(name: str, data: bytes) -> Observation:
    try:
        return decode_observation(data)
    except RejectedError as error:
        raise LockstepError(f"{name}: its observation cannot be decoded: {error}") from error


def _batch(name: str, data: bytes) -> Batch:
    try:
        return unpack_batch(data)
    except WireError as error:
        raise LockstepError(f"{name}: {error}") from error
