"""The medium in lockstep: each slot once, whole, and not before everybody who steps has spoken."""

from collections import deque
from collections.abc import Callable
from typing import NamedTuple

from netem.medium import Medium
from netem.messages import Done, MediumSetup, Turn, unpack_turn
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


class Waiting(NamedTuple):
    """What waits for one agent that has not stepped since: the newest batches, encoded."""

    incarnation: int
    batches: deque[bytes]


class LockstepMedium:
    """Plays the slots of one run as the world opens them, for some of the receivers or for all.

    Batches go out when their slot is opened, for by then it is known who steps in it: to somebody
    who is paused nothing is sent, so that nothing is left lying in his way.
    """

    def __init__(
        self, bus: Bus, setup: MediumSetup, shard: int, unwanted: Callable[[], bool]
    ) -> None:
        agents = range(setup.agents)
        self._setup = setup
        self._unwanted = unwanted
        self._slot = 0
        self._medium = Medium(setup, setup.receivers)
        self._own = frozenset(agents if setup.receivers is None else setup.receivers)
        self._waiting = {agent: Waiting(0, deque(maxlen=BATCH_RING)) for agent in agents}
        self._senders = [bus.subscriber("tx", agent, LOCKSTEP_RING) for agent in agents]
        self._receivers = [bus.publisher("rx", agent, lockstep=True) for agent in agents]
        self._done = bus.publisher("done", shard, lockstep=True)

    def hear(self, truths: list[bytes]) -> None:
        """Play the slots that the world opened.

        Raises LockstepError when somebody does not answer, or out of turn; RunOverError when the
        run ends meanwhile.
        """
        for opened in truths:
            self._play(opened)

    def report(self) -> None:
        """Say nothing at the end: each slot's counters have been told."""

    def _play(self, opened: bytes) -> None:
        turn = self._turn(opened)
        for order in turn.orders:
            self._medium.obey(order)
        self._medium.place(turn.truth.positions)
        self._hand_out(turn)
        for sender in turn.participants:
            self._transmit(sender, turn)
        self._collect(turn)
        pages = tuple(self._medium.pages().items())
        self._slot += 1
        self._done(pack(Done(turn.truth.slot, pages, self._medium.counters(self._slot))))

    def _turn(self, opened: bytes) -> Turn:
        try:
            turn = unpack_turn(opened)
        except WireError as error:
            raise LockstepError(f"the world's truth: {error}") from error
        check_slot("the world's truth", turn.truth.slot, self._slot)
        rows = {len(turn.truth.positions), len(turn.incarnations), self._setup.agents}
        if len(rows) > 1 or any(who >= self._setup.agents for who in turn.participants):
            raise LockstepError(f"the world's truth is not of {self._setup.agents} agents")
        return turn

    def _hand_out(self, turn: Turn) -> None:
        """Send what waits to those who step; who is gone, or is another by now, gets nothing."""
        for agent in self._own:
            incarnation, here = turn.incarnations[agent], turn.truth.positions[agent]
            if here is None or incarnation != self._waiting[agent].incarnation:
                self._waiting[agent] = Waiting(incarnation, deque(maxlen=BATCH_RING))
        for agent in turn.participants:
            if agent in self._own:
                batches = self._waiting[agent].batches
                self._receivers[agent](pack(Inbox(turn.truth.slot, tuple(batches))))
                batches.clear()

    def _transmit(self, sender: int, turn: Turn) -> None:
        slot = turn.truth.slot
        what = f"agent-{sender}'s transmission of slot {slot}"
        transmission = _read(what, await_message(self._senders[sender], what, self._unwanted))
        check_slot(what, transmission.slot, slot)
        if transmission.incarnation != turn.incarnations[sender]:
            raise LockstepError(f"{what} is of its incarnation {transmission.incarnation}")
        self._medium.transmit(sender, turn.truth.time_s, transmission)

    def _collect(self, turn: Turn) -> None:
        """Put by what is due in the next slot for those who may step in it."""
        slot, step = turn.truth.slot + 1, self._setup.slots_per_tick
        for agent in range(slot % step, self._setup.agents, step):
            if agent in self._own and turn.truth.positions[agent] is not None:
                frames = self._medium.collect(agent, slot / self._setup.slot_hz)
                self._waiting[agent].batches.append(pack(Batch(slot, frames)))


def _read(what: str, data: bytes) -> Transmission:
    try:
        return unpack_transmission(data)
    except WireError as error:
        raise LockstepError(f"{what}: {error}") from error
