"""An agent's core at the controls: one observation in, one command and one transmission out.

Free-running, what was heard by then is taken, and what cannot be read is counted. In lockstep an
agent waits for what its slot brings, and what is not of that slot ends the run.
"""

from collections.abc import Callable

from agent.codec import RejectedError, decode_observation, encode
from agent.core import Agent
from agent.messages import Observation
from agent.setup import AgentSetup
from netem.wire.frame import (
    BATCH_RING,
    Inbox,
    Outgoing,
    Transmission,
    WireError,
    pack,
    unpack_batch,
    unpack_inbox,
)
from netem.wire.post import Post, Put, Ring
from netem.wire.turns import TURN_RING, LockstepError, answer, same_slot


class Controls:
    """A core, and where what it decides goes."""

    def __init__(self, setup: AgentSetup, command: Put, radio: Put) -> None:
        self.core = Agent(setup)
        self._incarnation = setup.incarnation
        self._command = command
        self._radio = radio

    def hear(self, batch: bytes, now_s: float) -> None:
        """Take the frames of a batch. Raises WireError when it is none."""
        for frame in unpack_batch(batch).frames:
            self.core.receive(frame.source, frame.channel, frame.payload, now_s)

    def step(self, observation: Observation) -> None:
        """Step on an observation: say one command and one transmission."""
        outbox = self.core.step(observation)
        self._command(encode(outbox.command))
        frames = tuple(Outgoing(channel, payload) for channel, payload in outbox.frames)
        self._radio(pack(Transmission(observation.slot, self._incarnation, frames)))


class Cockpit:
    """Free-running: nobody is waited for."""

    def __init__(self, post: Post, setup: AgentSetup) -> None:
        command, radio = post.putter("command", setup.id), post.putter("tx", setup.id)
        self._controls = Controls(setup, command, radio)
        self._batches = post.ring("rx", setup.id, BATCH_RING)

    def see(self, data: bytes) -> None:
        """Step on an observation; one that cannot be read is counted."""
        try:
            observation = decode_observation(data)
        except RejectedError:
            self._controls.core.rejected["observation"] += 1
            return
        for batch in self._batches.drain(BATCH_RING):
            try:
                self._controls.hear(batch, observation.time_s)
            except WireError:
                self._controls.core.rejected["batch"] += 1
        self._controls.step(observation)


class Partner:
    """In lockstep: each observation has its inbox, and both are waited for.

    unwanted: whether the run is over.
    """

    def __init__(self, post: Post, setup: AgentSetup, unwanted: Callable[[], bool]) -> None:
        command = post.putter("command", setup.id, lockstep=True)
        self._controls = Controls(setup, command, post.putter("tx", setup.id, lockstep=True))
        self._inbox = post.ring("rx", setup.id, TURN_RING)
        self._unwanted = unwanted

    def see(self, data: bytes) -> None:
        """Step on an observation, with what was heard by its slot.

        Raises LockstepError where either is missing, cannot be read or is of another slot;
        UnwantedError when the run ends meanwhile.
        """
        try:
            observation = decode_observation(data)
        except RejectedError as error:
            raise LockstepError(f"an observation that cannot be read: {error}") from error
        what = f"the inbox of slot {observation.slot}"
        inbox = _inbox(what, self._inbox, self._unwanted)
        same_slot(what, inbox.slot, observation.slot)
        for batch in inbox.batches:
            self._controls.hear(batch, observation.time_s)
        self._controls.step(observation)


def _inbox(what: str, ring: Ring, unwanted: Callable[[], bool]) -> Inbox:
    try:
        return unpack_inbox(answer(ring, what, unwanted))
    except WireError as error:
        raise LockstepError(f"{what}: {error}") from error
