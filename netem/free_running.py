"""The medium on the wall clock: it plays a slot when its truth arrives, and waits for no agent.

The truth of a slot makes the medium take the transmissions that have arrived and send the batches
of the next slot, so a frame never arrives in the slot in which it was sent.
"""

import time
from collections import Counter, deque
from statistics import median

import msgspec

from netem.fault_queue import FaultQueue
from netem.medium import Medium
from netem.messages import MAX_TRUTH_B, MediumCounters, MediumSetup, Truth
from netem.sender_counts import CheckedFrames, FrameCheck, SenderCounts
from netem.wire.bus import Bus
from netem.wire.frame import (
    MAX_EARLY_US,
    Delivery,
    Transmission,
    WireError,
    pack,
    unpack,
    unpack_transmission,
)

ORDERS_RING = 256
LATENESS_KEPT = 4096


class Lateness:
    """How long after their due time batches leave [s; simulated time].

    The median is over the newest LATENESS_KEPT batches, the worst over all. The present simulated
    time is that of the newest truth, plus the time since it was read.
    """

    def __init__(self, speed: float) -> None:
        self._speed = speed
        self._kept: deque[float] = deque(maxlen=LATENESS_KEPT)
        self._worst_s = 0.0

    def record(self, due_s: float, newest_s: float, read_at: float) -> None:
        """Record that a batch due at ``due_s`` leaves now.

        newest_s: time of the newest truth [s; simulated time], which was read at ``read_at`` [s;
        monotonic clock].
        """
        now_s = newest_s + (time.monotonic() - read_at) * self._speed
        late_s = max(0.0, now_s - due_s)
        self._kept.append(late_s)
        self._worst_s = max(self._worst_s, late_s)

    def summary(self) -> tuple[float, float] | None:
        """Return median and worst [s; simulated time]; None before the first batch."""
        return (median(self._kept), self._worst_s) if self._kept else None


class Intake:
    """Decides which transmissions the medium takes, and counts rejected ones by cause."""

    def __init__(self, setup: MediumSetup) -> None:
        before = setup.resumes.counters if setup.resumes is not None else None
        self.rejected = Counter(before.rejected if before is not None else {})
        """Number of rejected messages by cause."""
        self.senders = SenderCounts(before.transmissions if before is not None else ())
        self.incarnations: tuple[int, ...] = (0,) * setup.agents
        """Row i = agent i's current incarnation, from the newest truth."""
        self._slots_per_tick = setup.slots_per_tick
        self._last: list[tuple[int, int]] = [(-1, -1)] * setup.agents
        self._early: dict[int, Transmission] = {}

    def due(self, sender: int, slot: int) -> Transmission | None:
        """Return a sender's early transmission when its slot is played."""
        early = self._early.get(sender)
        return self._early.pop(sender) if early is not None and early.slot <= slot else None

    def take(self, sender: int, data: bytes, slot: int) -> Transmission | None:
        """Return a transmission that arrived before ``slot`` is played; None where it is rejected.

        A process that resumes answers old observations, and the network may repeat a message:
        both are rejected. A transmission that arrives before the truth of its slot is kept until
        then, see ``due``.
        """
        try:
            transmission = unpack_transmission(data)
        except WireError as error:
            self._refuse(sender, str(error).split(" ", 1)[0].rstrip(":"))
            return None
        cause = self._rejection(sender, transmission, slot)
        if cause is not None:
            self._refuse(sender, cause)
            return None
        self.senders.count(sender, None)
        self._last[sender] = (transmission.incarnation, transmission.slot)
        if transmission.slot > slot:
            self._early[sender] = transmission
            return None
        return transmission

    def _refuse(self, sender: int, cause: str) -> None:
        self.rejected[cause] += 1
        self.senders.count(sender, cause)

    def _rejection(self, sender: int, transmission: Transmission, slot: int) -> str | None:
        """Return the cause for which a transmission is rejected, or None."""
        if transmission.incarnation != self.incarnations[sender]:
            return "incarnation"
        if transmission.slot > slot + self._slots_per_tick or sender in self._early:
            return "ahead"
        if transmission.slot < slot - self._slots_per_tick:
            return "stale"
        if (transmission.incarnation, transmission.slot) <= self._last[sender]:
            return "repeated"
        return None


class FreeRunningMedium:
    """Plays the slots of one run on the wall clock. check: of foreign agents' frames."""

    def __init__(self, bus: Bus, setup: MediumSetup, check: FrameCheck | None = None) -> None:
        self._setup = setup
        self._medium = Medium(setup)
        before = setup.resumes.counters if setup.resumes is not None else None
        self._checked = CheckedFrames(check, before.frames if before is not None else ())
        self._intake = Intake(setup)
        self._lateness = Lateness(setup.speed)
        agents = range(setup.agents)
        self._senders = bus.fair_subscriber("tx", agents)
        self._receivers = [bus.publisher("rx", agent) for agent in agents]
        self._orders = bus.subscriber("orders", size=ORDERS_RING)
        self._faults = FaultQueue()
        self._report = bus.publisher("verdicts")
        self._report_every = max(1, round(setup.slot_hz))
        self._slot = setup.resumes.slot if setup.resumes is not None else 0

    def play(self, inputs: list[bytes]) -> None:
        """Play the slots whose truths have arrived, oldest first."""
        read_at = time.monotonic()
        truths = [truth for truth in map(self._truth, inputs) if truth is not None]
        for truth in truths:
            self._play(truth, truths[-1].time_s, read_at)

    def report(self) -> None:
        """Send the world the counters after the last slot played."""
        counters: MediumCounters = msgspec.structs.replace(
            self._medium.counters(self._slot),
            rejected=dict(self._intake.rejected),
            late_s=self._lateness.summary(),
            transmissions=self._intake.senders.rows(),
            frames=self._checked.rows(),
        )
        self._report(pack(counters))

    def _truth(self, data: bytes) -> Truth | None:
        """Return a decoded truth; None, and counted as rejected, where it does not fit the run."""
        try:
            truth = unpack(data, Truth, MAX_TRUTH_B)
        except WireError:
            self._intake.rejected["truth"] += 1
            return None
        rows = {len(truth.positions), len(truth.incarnations), self._setup.agents}
        if len(rows) > 1 or truth.slot < self._slot:
            self._intake.rejected["truth"] += 1
            return None
        return truth

    def _play(self, truth: Truth, newest_s: float, read_at: float) -> None:
        self._apply_faults(truth.slot)
        self._intake.incarnations = truth.incarnations
        self._medium.place(truth.positions)
        self._take_transmissions(truth.slot)
        self._medium.sabotage(truth.slot / self._setup.slot_hz)
        self._send_batches(truth.slot + 1, newest_s, read_at)
        self._slot = truth.slot + 1
        if self._slot % self._report_every == 0:
            self.report()

    def _apply_faults(self, slot: int) -> None:
        """Apply the fault orders for slots up to this one."""
        for data in self._orders.drain(ORDERS_RING):
            try:
                self._faults.put(data)
            except WireError:
                self._intake.rejected["orders"] += 1
        for order in self._faults.due(slot):
            self._medium.apply(order)

    def _take_transmissions(self, slot: int) -> None:
        for sender, messages in self._senders.drain():
            self._transmit(sender, self._intake.due(sender, slot))
            for data in messages:
                self._transmit(sender, self._intake.take(sender, data, slot))

    def _transmit(self, sender: int, transmission: Transmission | None) -> None:
        if transmission is not None:
            sent_s = transmission.slot / self._setup.slot_hz
            self._checked.note(sender, transmission.frames, sent_s)
            self._medium.transmit(sender, sent_s, transmission)

    def _send_batches(self, slot: int, newest_s: float, read_at: float) -> None:
        """Send their batches to the agents that step in a slot."""
        due_s = slot / self._setup.slot_hz
        group = slot % self._setup.slots_per_tick
        for receiver in range(group, self._setup.agents, self._setup.slots_per_tick):
            frames_due_s: list[float] = []
            frames = self._medium.collect(receiver, due_s, frames_due_s)
            early_us = tuple([_microseconds(due_s - each_s) for each_s in frames_due_s])
            self._receivers[receiver](pack(Delivery(slot, frames, early_us)))
        self._lateness.record(due_s, newest_s, read_at)


def _microseconds(early_s: float) -> int:
    return min(round(1e6 * early_s), MAX_EARLY_US)
