"""The medium free-running: slots are played as their truths come, with what was sent by then.

Each slot's truth makes the medium take in what was sent so far and hand out the batches of the next
slot, so a frame never arrives in the slot in which it was sent.
"""

import time
from collections import Counter, deque
from statistics import median

import msgspec

from netem.fault_queue import FaultQueue
from netem.medium import Medium
from netem.messages import MAX_TRUTH_B, MediumCounters, MediumSetup, Truth
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
    """How much later than due batches left [simulated s]: the median of the last ones, the worst.

    The present simulated time is that of the newest truth, and what has passed since it was read.
    """

    def __init__(self, speed: float) -> None:
        self._speed = speed
        self._kept: deque[float] = deque(maxlen=LATENESS_KEPT)
        self._worst_s = 0.0

    def note(self, due_s: float, newest_s: float, read_at: float) -> None:
        """Note a batch due at ``due_s``, leaving now; the newest truth is of ``newest_s``."""
        now_s = newest_s + (time.monotonic() - read_at) * self._speed
        late_s = max(0.0, now_s - due_s)
        self._kept.append(late_s)
        self._worst_s = max(self._worst_s, late_s)

    def summary(self) -> tuple[float, float] | None:
        """Return median and worst [s], or None before the first batch."""
        return (median(self._kept), self._worst_s) if self._kept else None


class Intake:
    """Decides which of the senders' messages the medium takes, and counts the others by cause.

    incarnations: which of its processes each agent is at present, as the world has it.
    """

    def __init__(self, setup: MediumSetup) -> None:
        self.rejected: Counter[str] = Counter()
        self.incarnations: tuple[int, ...] = (0,) * setup.agents
        self._slots_per_tick = setup.slots_per_tick
        self._last: list[tuple[int, int]] = [(-1, -1)] * setup.agents
        self._early: dict[int, Transmission] = {}

    def due(self, sender: int, slot: int) -> Transmission | None:
        """Return what came before its slot was played, once it is."""
        early = self._early.get(sender)
        return self._early.pop(sender) if early is not None and early.slot <= slot else None

    def take(self, sender: int, data: bytes, slot: int) -> Transmission | None:
        """Return a sender's message as it arrived by ``slot``, or None where it is refused.

        A process that was stopped for a while answers old observations when it goes on; a copy of
        an earlier message may come at any time. Neither reaches the air. An agent that is quicker
        than the truth on its way here waits for it: see ``due``.
        """
        try:
            transmission = unpack_transmission(data)
        except WireError as error:
            self.rejected[str(error).split(" ", 1)[0].rstrip(":")] += 1
            return None
        cause = self._cause(sender, transmission, slot)
        if cause is not None:
            self.rejected[cause] += 1
            return None
        self._last[sender] = (transmission.incarnation, transmission.slot)
        if transmission.slot > slot:
            self._early[sender] = transmission
            return None
        return transmission

    def _cause(self, sender: int, transmission: Transmission, slot: int) -> str | None:
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
    """The medium between the agents of one run, slot by slot."""

    def __init__(self, bus: Bus, setup: MediumSetup) -> None:
        self._setup = setup
        self._medium = Medium(setup)
        self._intake = Intake(setup)
        self._lateness = Lateness(setup.speed)
        agents = range(setup.agents)
        self._senders = bus.fair_subscriber("tx", agents)
        self._receivers = [bus.publisher("rx", agent) for agent in agents]
        self._orders = bus.subscriber("orders", size=ORDERS_RING)
        self._book = FaultQueue()
        self._report = bus.publisher("verdicts")
        self._report_every = max(1, round(setup.slot_hz))
        self._slot = 0

    def hear(self, truths: list[bytes]) -> None:
        """Play the slots whose truths have come, oldest first."""
        read_at = time.monotonic()
        known = [truth for truth in map(self._truth, truths) if truth is not None]
        for truth in known:
            self._play(truth, known[-1].time_s, read_at)

    def report(self) -> None:
        """Tell the world the counters as they stand after the last slot played."""
        medium_counters: MediumCounters = msgspec.structs.replace(
            self._medium.counters(self._slot),
            rejected=dict(self._intake.rejected),
            late_s=self._lateness.summary(),
        )
        self._report(pack(medium_counters))

    def _truth(self, data: bytes) -> Truth | None:
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
        self._obey(truth.slot)
        self._intake.incarnations = truth.incarnations
        self._medium.place(truth.positions)
        self._ingest(truth.slot)
        self._deliver(truth.slot + 1, newest_s, read_at)
        self._slot = truth.slot + 1
        if self._slot % self._report_every == 0:
            self.report()

    def _obey(self, slot: int) -> None:
        """Carry out what was ordered for slots up to this one."""
        for data in self._orders.drain(ORDERS_RING):
            try:
                self._book.take(data)
            except WireError:
                self._intake.rejected["orders"] += 1
        for order in self._book.due(slot):
            self._medium.obey(order)

    def _ingest(self, slot: int) -> None:
        for sender, said in self._senders.drain():
            self._send(sender, self._intake.due(sender, slot))
            for data in said:
                self._send(sender, self._intake.take(sender, data, slot))

    def _send(self, sender: int, transmission: Transmission | None) -> None:
        if transmission is not None:
            sent_s = transmission.slot / self._setup.slot_hz
            self._medium.transmit(sender, sent_s, transmission)

    def _deliver(self, slot: int, newest_s: float, read_at: float) -> None:
        due_s = slot / self._setup.slot_hz
        group = slot % self._setup.slots_per_tick
        for receiver in range(group, self._setup.agents, self._setup.slots_per_tick):
            frames_due_s: list[float] = []
            frames = self._medium.collect(receiver, due_s, frames_due_s)
            early_us = tuple([_microseconds(due_s - each_s) for each_s in frames_due_s])
            self._receivers[receiver](pack(Delivery(slot, frames, early_us)))
        self._lateness.note(due_s, newest_s, read_at)


def _microseconds(early_s: float) -> int:
    return min(round(1e6 * early_s), MAX_EARLY_US)
