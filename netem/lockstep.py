"""The medium in lockstep: it plays a slot when the transmissions of all its participants are in."""

from collections import deque
from collections.abc import Callable
from typing import NamedTuple

from msgspec.structs import replace

from netem.medium import Medium
from netem.messages import MediumSetup, SlotInput, SlotResult, unpack_slot_input
from netem.sender_counts import CheckedFrames, FrameCheck
from netem.wire.barrier import LOCKSTEP_RING, LockstepError, await_message, check_slot
from netem.wire.bus import Bus
from netem.wire.frame import (
    BATCH_RING,
    Batch,
    Inbox,
    Transmission,
    WireError,
    pack,
    unpack_transmission,
)


class PendingBatches(NamedTuple):
    """The newest batches for one agent since its last step."""

    incarnation: int
    """The incarnation of the agent that the batches are for."""
    batches: deque[bytes]
    """Encoded, oldest first."""


class LockstepMedium:
    """Plays the slots of one run in lockstep, as one shard of the medium.

    Batches leave when their slot is opened, since only then its participants are known. A paused
    agent is sent nothing, so that no stale batch waits for it when it resumes. check: of foreign
    agents' frames.
    """

    def __init__(
        self,
        bus: Bus,
        setup: MediumSetup,
        shard: int,
        should_stop: Callable[[], bool],
        check: FrameCheck | None = None,
    ) -> None:
        agents = range(setup.agents)
        self._setup = setup
        self._should_stop = should_stop
        self._slot = 0
        self._medium = Medium(setup, setup.receivers)
        self._checked = CheckedFrames(check)
        self._own = frozenset(agents if setup.receivers is None else setup.receivers)
        self._pending = {agent: PendingBatches(0, deque(maxlen=BATCH_RING)) for agent in agents}
        self._senders = [bus.subscriber("tx", agent, LOCKSTEP_RING) for agent in agents]
        self._receivers = [bus.publisher("rx", agent, lockstep=True) for agent in agents]
        self._report = bus.publisher("done", shard, lockstep=True)

    def play(self, inputs: list[bytes]) -> None:
        """Play the slots that the world opened.

        Raises LockstepError when an agent's transmission is missing or of another slot,
        RunOverError when the run ends meanwhile.
        """
        for data in inputs:
            self._play(self._slot_input(data))

    def report(self) -> None:
        """Do nothing at the end of the run: every slot's result held the counters."""

    def _play(self, slot_input: SlotInput) -> None:
        for order in slot_input.orders:
            self._medium.apply(order)
        self._medium.place(slot_input.truth.positions)
        self._send_inboxes(slot_input)
        for sender in slot_input.participants:
            self._transmit(sender, slot_input)
        self._medium.sabotage(slot_input.truth.time_s)
        self._queue_batches(slot_input)
        pages = tuple(self._medium.pages().items())
        self._slot += 1
        counters = replace(self._medium.counters(self._slot), frames=self._checked.rows())
        self._report(pack(SlotResult(slot=slot_input.truth.slot, pages=pages, counters=counters)))

    def _slot_input(self, data: bytes) -> SlotInput:
        try:
            slot_input = unpack_slot_input(data)
        except WireError as error:
            raise LockstepError(f"the world's truth: {error}") from error
        check_slot("the world's truth", slot_input.truth.slot, self._slot)
        rows = {len(slot_input.truth.positions), len(slot_input.incarnations), self._setup.agents}
        if len(rows) > 1 or max(slot_input.participants, default=0) >= self._setup.agents:
            raise LockstepError(f"the world's truth is not of {self._setup.agents} agents")
        if len(slot_input.observations) != len(slot_input.participants):
            raise LockstepError("the world's truth has not one observation for each participant")
        return slot_input

    def _send_inboxes(self, slot_input: SlotInput) -> None:
        """Send the participants their observations, and the batches that wait for them.

        Batches for an agent that is gone, or for an earlier incarnation of it, are dropped.
        """
        truth = slot_input.truth
        for agent in self._own:
            incarnation = slot_input.incarnations[agent]
            gone = truth.positions[agent] is None
            if gone or incarnation != self._pending[agent].incarnation:
                self._pending[agent] = PendingBatches(incarnation, deque(maxlen=BATCH_RING))
        for agent, observation in zip(
            slot_input.participants, slot_input.observations, strict=True
        ):
            if agent in self._own:
                batches = self._pending[agent].batches
                self._receivers[agent](pack(Inbox(truth.slot, observation, tuple(batches))))
                batches.clear()

    def _transmit(self, sender: int, slot_input: SlotInput) -> None:
        """Wait for a participant's transmission, and send its frames."""
        slot = slot_input.truth.slot
        what = f"agent-{sender}'s transmission of slot {slot}"
        transmission = _unpacked(
            what, await_message(self._senders[sender], what, self._should_stop)
        )
        check_slot(what, transmission.slot, slot)
        if transmission.incarnation != slot_input.incarnations[sender]:
            raise LockstepError(f"{what} is of its incarnation {transmission.incarnation}")
        self._checked.note(sender, transmission.frames, slot_input.truth.time_s)
        self._medium.transmit(sender, slot_input.truth.time_s, transmission)

    def _queue_batches(self, slot_input: SlotInput) -> None:
        """Queue the frames due in the next slot for the agents of its group."""
        if self._medium.down:
            return
        slot, step = slot_input.truth.slot + 1, self._setup.slots_per_tick
        for agent in range(slot % step, self._setup.agents, step):
            if agent in self._own and slot_input.truth.positions[agent] is not None:
                frames = self._medium.collect(agent, slot / self._setup.slot_hz)
                self._pending[agent].batches.append(pack(Batch(slot, frames)))


def _unpacked(what: str, data: bytes) -> Transmission:
    try:
        return unpack_transmission(data)
    except WireError as error:
        raise LockstepError(f"{what}: {error}") from error
