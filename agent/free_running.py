"""An agent's core at the controls: one observation in, one command and one transmission out.

Free-running, what was heard by then is taken, and what cannot be read is counted. In lockstep an
agent waits for what its slot brings, and what is not of that slot ends the run.
"""

from collections import deque
from collections.abc import Callable

from agent.codec import RejectedError, decode_observation, encode
from agent.config import AgentSetup
from agent.core import Agent
from agent.messages import Observation
from netem.wire.barrier import TURN_RING, LockstepError, answer, same_slot
from netem.wire.bus import Post, Put, Ring
from netem.wire.frame import (
    BATCH_RING,
    Batch,
    Delivery,
    Inbox,
    Outgoing,
    Transmission,
    WireError,
    pack,
    unpack_batch,
    unpack_delivery,
    unpack_inbox,
)
from netem.wire.latency import Tally


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
        frames = tuple(Outgoing(channel, payload) for channel, payload in outbox.frames)
        self._radio(pack(Transmission(observation.slot, self._incarnation, frames)))


class Cockpit:
    """Free-running: nobody is waited for, and how late each frame comes is counted."""

    def __init__(self, post: Post, setup: AgentSetup) -> None:
        command, radio = post.putter("command", setup.id), post.putter("tx", setup.id)
        self._controls = Controls(setup, command, radio)
        self._batches = post.ring("rx", setup.id, BATCH_RING)
        self._early: deque[Delivery] = deque(maxlen=BATCH_RING)
        self._incarnation = setup.incarnation
        self._slots_a_report = round(setup.slots_per_tick * setup.tick_hz)
        self._tally = Tally(1.0 / (setup.slots_per_tick * setup.tick_hz))
        self._tell = post.putter("arrivals", setup.id)
        self._report_at = self._slots_a_report + setup.id % self._slots_a_report

    def see(self, data: bytes) -> None:
        """Step on an observation; one that cannot be read is counted."""
        try:
            observation = decode_observation(data)
        except RejectedError:
            self._controls.core.rejected["observation"] += 1
            return
        self._hear(observation)
        self._controls.step(observation)
        if observation.slot >= self._report_at:
            self._report_at = observation.slot + self._slots_a_report
            self.report()

    def report(self) -> None:
        """Tell the world how late the frames came so far."""
        self._tell(pack(self._tally.told(self._incarnation)))

    def _hear(self, observation: Observation) -> None:
        """Take what has come by an observation; what is of a later slot waits for it.

        Who was kept from stepping finds newer batches beside an older observation.
        """
        for data in self._batches.drain(BATCH_RING):
            try:
                self._early.append(unpack_delivery(data))
            except WireError:
                self._controls.core.rejected["batch"] += 1
        while self._early and self._early[0].slot <= observation.slot:
            batch = self._early.popleft()
            self._tally.note(batch.frames, batch.early_us, observation.slot - batch.slot)
            self._controls.hear(batch, observation.time_s)


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
            self._controls.hear(_batch(what, batch), observation.time_s)
        self._controls.step(observation)

    def report(self) -> None:
        """Say nothing: in turns nothing is late."""


def _inbox(what: str, ring: Ring, unwanted: Callable[[], bool]) -> Inbox:
    try:
        return unpack_inbox(answer(ring, what, unwanted))
    except WireError as error:
        raise LockstepError(f"{what}: {error}") from error


def _batch(what: str, data: bytes) -> Batch:
    try:
        return unpack_batch(data)
    except WireError as error:
        raise LockstepError(f"{what}: {error}") from error
