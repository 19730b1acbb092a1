"""The lockstep shell of an agent: it waits for both the observation and the inbox of each slot.

A message of another slot ends the run.
"""

from collections.abc import Callable

from agent.codec import decode_observation
from agent.config import AgentSetup
from agent.rejection import RejectedError
from agent.step_page import StepGuard
from agent.stepping import AgentStepper
from netem.wire.barrier import LOCKSTEP_RING, LockstepError, await_message, check_slot
from netem.wire.bus import Bus, Subscriber
from netem.wire.frame import Batch, Inbox, WireError, unpack_batch, unpack_inbox


class LockstepAgent:
    """An agent in lockstep. run_is_over: asked while it waits for an inbox."""

    def __init__(
        self,
        bus: Bus,
        setup: AgentSetup,
        run_is_over: Callable[[], bool],
        guard: StepGuard | None = None,
    ) -> None:
        command = bus.publisher("command", setup.id, lockstep=True)
        radio = bus.publisher("tx", setup.id, lockstep=True)
        self._stepper = AgentStepper(setup, command, radio, guard)
        self._inbox = bus.subscriber("rx", setup.id, LOCKSTEP_RING)
        self._run_is_over = run_is_over

    def observe(self, data: bytes) -> None:
        """Step on an encoded observation, with the inbox of its slot.

        Raises LockstepError if either is missing, cannot be decoded or is of another slot;
        UnwantedError if the run ends while it waits.
        """
        try:
            observation = decode_observation(data)
        except RejectedError as error:
            raise LockstepError(f"an observation cannot be decoded: {error}") from error
        name = f"the inbox of slot {observation.slot}"
        inbox = _inbox(name, self._inbox, self._run_is_over)
        check_slot(name, inbox.slot, observation.slot)
        for batch in inbox.batches:
            self._stepper.receive(_batch(name, batch), observation.time_s)
        self._stepper.step(observation)

    def report(self) -> None:
        """Report nothing: in lockstep no frame is late."""


def _inbox(name: str, subscriber: Subscriber, run_is_over: Callable[[], bool]) -> Inbox:
    try:
        return unpack_inbox(await_message(subscriber, name, run_is_over))
    except WireError as error:
        raise LockstepError(f"{name}: {error}") from error


def _batch(name: str, data: bytes) -> Batch:
    try:
        return unpack_batch(data)
    except WireError as error:
        raise LockstepError(f"{name}: {error}") from error
