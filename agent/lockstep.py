"""The lockstep shell of an agent: each observation has its inbox, and it waits for both.

A message of another slot ends the run.
"""

from collections.abc import Callable

from agent.codec import RejectedError, decode_observation
from agent.config import AgentSetup
from agent.stepping import Controls
from netem.wire.barrier import LOCKSTEP_RING, LockstepError, await_message, check_slot
from netem.wire.bus import Bus, Subscriber
from netem.wire.frame import Batch, Inbox, WireError, unpack_batch, unpack_inbox


class LockstepAgent:
    """In lockstep: each observation has its inbox, and both are waited for.

    unwanted: whether the run is over.
    """

    def __init__(self, bus: Bus, setup: AgentSetup, unwanted: Callable[[], bool]) -> None:
        command = bus.publisher("command", setup.id, lockstep=True)
        self._controls = Controls(setup, command, bus.publisher("tx", setup.id, lockstep=True))
        self._inbox = bus.subscriber("rx", setup.id, LOCKSTEP_RING)
        self._unwanted = unwanted

    def see(self, data: bytes) -> None:
        """Step on an observation, with what was heard by its slot.

        Raises LockstepError where either is missing, cannot be read or is of another slot;
        RunOverError when the run ends meanwhile.
        """
        try:
            observation = decode_observation(data)
        except RejectedError as error:
            raise LockstepError(f"an observation that cannot be read: {error}") from error
        what = f"the inbox of slot {observation.slot}"
        inbox = _inbox(what, self._inbox, self._unwanted)
        check_slot(what, inbox.slot, observation.slot)
        for batch in inbox.batches:
            self._controls.hear(_batch(what, batch), observation.time_s)
        self._controls.step(observation)

    def report(self) -> None:
        """Say nothing: in turns nothing is late."""


def _inbox(what: str, ring: Subscriber, unwanted: Callable[[], bool]) -> Inbox:
    try:
        return unpack_inbox(await_message(ring, what, unwanted))
    except WireError as error:
        raise LockstepError(f"{what}: {error}") from error


def _batch(what: str, data: bytes) -> Batch:
    try:
        return unpack_batch(data)
    except WireError as error:
        raise LockstepError(f"{what}: {error}") from error
