"""The radio medium: the frames in flight, and the fate of every frame.

A pure state machine; time is an argument. ``transmit`` decides the fate of a frame on each link
when it is sent, and ``collect`` returns the frames that are due at a receiver. Deliveries are in
canonical order, (due, source, incarnation, channel, count, copy), so the result does not depend on
the order in which transmissions arrive.
"""

from bisect import bisect_right
from collections.abc import Iterable, Mapping, Sequence
from hashlib import sha256
from math import inf
from typing import Any, Final

import msgspec

from netem.conditions import NetworkConditions, differing
from netem.delivery_log import FATE, HEAD, WHOLE, DeliveryLog
from netem.faults import FaultOrder, Outage, Position, Sabotage
from netem.link import LOST_TO_PARTITION, LOST_TO_QUEUE, Cause, Links, Sending, Verdict
from netem.link_model import LinkModel
from netem.messages import NEW_RUN, MediumCounters, MediumSetup, packet_counters
from netem.range_index import InRange, RangeIndex
from netem.rate_queue import RateQueue
from netem.saboteur import Saboteur
from netem.wire.channels import CHANNELS, MAX_PAYLOAD_B
from netem.wire.frame import (
    BATCH_HEAD_B,
    FRAME_HEAD_B,
    MAX_BATCH_B,
    MAX_FRAMES,
    MAX_OUTGOING,
    Frame,
    Transmission,
)

DELIVERED: Final = int(Cause.DELIVERED)
DROPPED_RANGE: Final = int(Cause.DROPPED_RANGE)
FATES = tuple(cause.name.lower() for cause in Cause)
SURELY_FIT: Final = (MAX_BATCH_B - BATCH_HEAD_B) // (FRAME_HEAD_B + MAX_PAYLOAD_B)
"""This many frames fit one batch, whatever their payloads."""
FIRST_FORGED = 2**52
"""From here on saboteurs' frames are counted: agents' own keep numbers and fates."""
_InFlight = tuple[Any, ...]
"""A frame in a receiver's queue: due time [s], source, incarnation, channel, count, copy, frame.

Compiled code would make a tuple of known types anew for each receiver, and take it apart.
"""


class Medium:
    """The radio between all agents.

    receivers: the agents that this medium delivers to; None: all. Shards that divide the receivers
    and get every transmission decide together what one medium decides.

    Conservation law: ``addressed`` (frames sent, times the other agents, present or not, plus one
    for each duplicate) always equals the sum of all fates plus the frames in flight. A frame to an
    absent radio counts as out of range; frames in flight to a radio that disappears are dropped by
    the medium.
    """

    def __init__(self, setup: MediumSetup, receivers: Iterable[int] | None = None) -> None:
        own = tuple(sorted(range(setup.agents) if receivers is None else receivers))
        self._own = frozenset(own)
        self._seed = sha256(b"qswarm medium %d" % setup.seed).digest()
        self._links = Links(self._seed)
        self._conditions = NetworkConditions(setup.conditions)
        self._range_index = RangeIndex(setup.agents, own)
        self._others = [len(own) - (agent in self._own) for agent in range(setup.agents)]
        self._queues: list[list[_InFlight]] = [[] for _ in range(setup.agents)]
        self._counts: dict[tuple[int, int, int], int] = {}
        self._rate_queues: dict[tuple[int, int], RateQueue] = {}
        self._fates = [0] * len(Cause)
        self._struck: dict[int, int] = {}
        """Frames, times the links on which a fault cut, altered or sent them, by its number."""
        self._saboteurs: dict[int, Saboteur] = {}
        """By the number of the fault in force."""
        self._next_forged = FIRST_FORGED
        self._delivery_log = DeliveryLog(setup.agents)
        self._sent_b = [0] * (len(CHANNELS) * setup.agents)
        self.sent = self.addressed = self.in_flight = self.duplicated = self.corrupted = 0
        resumes = setup.resumes or NEW_RUN
        self._first_count = resumes.slot * MAX_OUTGOING
        """Above the count of every frame that an earlier medium of the run has seen."""
        self._next_forged += self._first_count
        for order in resumes.orders:
            self.apply(order)
        self._miss(resumes.slot / setup.slot_hz)
        if resumes.counters is not None:
            self._count_on(resumes.counters)

    def redraw(self, seed: int) -> None:
        """Draw the fate of every later frame from another seed; link state and frames stay."""
        self._seed = sha256(b"qswarm medium %d" % seed).digest()
        self._links.redraw(self._seed)
        for saboteur in self._saboteurs.values():
            saboteur.redraw(self._seed)

    def place(self, positions: tuple[Position | None, ...]) -> None:
        """Set the positions, row i = agent i [m; world frame]; None where there is no radio."""
        self._range_index.place(positions)
        if None in positions:
            for receiver, position in enumerate(positions):
                if position is None and self._queues[receiver]:
                    self.discard(receiver)

    def apply(self, order: FaultOrder) -> None:
        """Begin or end a fault, between slots; of all faults only a kill affects frames in flight.

        A kill takes them, and what is remembered of links and queues, as the process's end does.
        """
        self._conditions.apply(order)
        number, fault = order.number, order.fault
        if isinstance(fault, Sabotage):
            self._saboteurs[number] = Saboteur(self._seed, number, order.at_s, fault)
        elif fault is None:
            self._saboteurs.pop(number, None)
        elif isinstance(fault, Outage) and fault.cause == "kill":
            self._links = Links(self._seed)
            self._rate_queues.clear()
            for receiver in self._own:
                self.discard(receiver)

    @property
    def down(self) -> bool:
        """Whether an outage is in force: no frame is sent or collected."""
        return bool(self._conditions.outages)

    def transmit(self, source: int, sent_s: float, transmission: Transmission) -> None:
        """Send one agent's frames of one slot at ``sent_s`` [s]: decide their fate on each link."""
        incarnation = transmission.incarnation
        for outgoing in transmission.frames:
            channel, payload = outgoing.channel, outgoing.payload
            count_key = (source, incarnation, channel)
            count = self._counts.get(count_key, -1)
            if count < 0:
                count = self._first_count
                self._forget_older(source, incarnation)
            self._counts[count_key] = count + 1
            frame = Frame(source, incarnation, channel, count, payload)
            self._send(Sending(frame, (source, incarnation, channel, count), sent_s, 0.0))
        if self._saboteurs:
            for saboteur in self._saboteurs.values():
                saboteur.overhear(source, sent_s, transmission)

    def _forget_older(self, source: int, incarnation: int) -> None:
        """Forget how many frames the earlier processes of an agent have sent."""
        for key in [each for each in self._counts if each[0] == source and each[1] < incarnation]:
            del self._counts[key]

    def sabotage(self, now_s: float) -> None:
        """Send the saboteurs' frames of the slot that began at ``now_s`` [s], after all agents'."""
        if self.down:
            self._miss(now_s)
            return
        for number, saboteur in self._saboteurs.items():
            for forged in saboteur.due(now_s):
                if self._range_index.positions[forged.victim] is None:
                    continue  # its radio is off, for a saboteur too
                before = self.in_flight
                count = self._next_forged
                self._next_forged += 1
                key = (forged.victim, forged.incarnation, forged.channel, count)
                self._send(Sending(Frame(*key, forged.payload), key, now_s, 0.0))
                received = self.in_flight - before
                self._struck[number] = self._struck.get(number, 0) + received

    def _miss(self, now_s: float) -> None:
        """Lose the saboteurs' frames that are due by a time [s]."""
        for saboteur in self._saboteurs.values():
            saboteur.miss(now_s)

    def collect(
        self, receiver: int, now_s: float, due_s: list[float] | None = None
    ) -> tuple[Frame, ...]:
        """Remove and return the frames that are due at a receiver by ``now_s`` [s].

        At most one batch; further frames stay in flight and come first the next time. due_s: a list
        to which the due time [s] of each returned frame is appended.
        """
        queue = self._queues[receiver]
        if not queue:
            return ()
        queue.sort()
        count = len(queue)
        if queue[-1][0] > now_s:
            count = bisect_right(queue, (now_s, inf))
        if count > SURELY_FIT:
            count = _count_fitting(queue[:count])
        taken, self._queues[receiver] = queue[:count], queue[count:]
        if due_s is not None:
            due_s.extend([entry[0] for entry in taken])
        self.in_flight -= count
        self._fates[DELIVERED] += count
        return tuple([entry[-1] for entry in taken])

    def discard(self, receiver: int) -> None:
        """Drop the frames in flight to a receiver that has disappeared, or to all at a kill."""
        lost = len(self._queues[receiver])
        self._queues[receiver].clear()
        self.in_flight -= lost
        self._fates[Cause.DROPPED_MEDIUM] += lost

    def _count_on(self, counters: MediumCounters) -> None:
        """Continue the counters of an earlier medium of the run."""
        self.sent, self.addressed = counters.sent, counters.addressed
        self.duplicated, self.corrupted = counters.duplicated, counters.corrupted
        self._fates = [counters.fates.get(fate, 0) for fate in FATES]
        self._struck = dict(counters.struck)
        if counters.sent_b:
            self._sent_b = list(counters.sent_b)

    def digest(self) -> bytes:
        """End the slot in the delivery log; return the hash over all verdicts of the run.

        The hash depends on where slots end: call this once at the end of each slot.
        """
        return self._delivery_log.digest()

    def pages(self) -> Mapping[int, bytes]:
        """End the slot in the delivery log; return its pages, see ``delivery_log.joined_pages``."""
        return self._delivery_log.take_pages()

    def packets(self) -> dict[str, int]:
        """Return the packet counters under their keys of summary.json."""
        return packet_counters(
            self.sent,
            self.addressed,
            dict(zip(FATES, self._fates, strict=True)),
            duplicated=self.duplicated,
            corrupted=self.corrupted,
            in_flight=self.in_flight,
        )

    def counters(self, slot: int) -> MediumCounters:
        """Return the counters before a slot. Ends the slot in the delivery log, as digest does."""
        return msgspec.structs.replace(self._counters(slot), digest=self.digest())

    def _counters(self, slot: int) -> MediumCounters:
        return MediumCounters(
            slot=slot,
            sent=self.sent,
            addressed=self.addressed,
            fates=dict(zip(FATES, self._fates, strict=True)),
            in_flight=self.in_flight,
            rejected={},
            duplicated=self.duplicated,
            corrupted=self.corrupted,
            sent_b=tuple(self._sent_b),
            struck=tuple(sorted(self._struck.items())),
        )

    def _send(self, sending: Sending) -> None:
        """Count a frame; decide its fate on its link to every other agent, in ascending order."""
        source, _, channel, _ = sending.key
        models = self._conditions.models
        self.sent += 1
        self._sent_b[len(CHANNELS) * source + channel] += len(sending.frame.payload)
        self.addressed += self._others[source]
        if self._conditions.without:
            self._count_altered(source, channel)
        model = models.of_channel(channel)
        if model.rate_kbit < inf:
            waited_s = self._enter_rate_queue(sending, model)
            if waited_s is None:
                return
            sending = Sending(sending.frame, sending.key, sending.sent_s, waited_s)
        near = self._range_index.in_range(source, models.reach_m(channel, source))
        self._fates[DROPPED_RANGE] += self._others[source] - len(near)
        common = models.common(channel, source)
        if common is None or not common.plain or self._conditions.obstructed:
            self._decide_each(sending, near)
        elif common.draws:
            self._decide_plain(sending, near, common)
        else:
            self._deliver_all(sending, near, sending.waited_s + common.clean_delay_s)

    def _count_altered(self, source: int, channel: int) -> None:
        """Count a frame for each change of conditions, times the links that it makes differ."""
        models = self._conditions.models
        for number, without in self._conditions.without.items():
            reach_m = max(models.reach_m(channel, source), without.reach_m(channel, source))
            near = self._range_index.in_range(source, reach_m)
            links = differing(models, without, channel, source, near)
            if links:
                self._struck[number] = self._struck.get(number, 0) + links

    def _enter_rate_queue(self, sending: Sending, model: LinkModel) -> float | None:
        """Return the delay in the queue of the sender's channel [s].

        Where the queue is full, drop the frame and return None.
        """
        source, _, channel, _ = sending.key
        queue = self._rate_queues.setdefault((source, channel), RateQueue())
        size_b = len(sending.frame.payload) + model.rate_overhead_b
        waited_s = queue.enter(sending.sent_s, size_b, model.rate_kbit, model.limit)
        if waited_s is None:
            self._fates[Cause.DROPPED_QUEUE] += self._others[source]
            if source in self._own:
                verdict = FATE(0, LOST_TO_QUEUE.cause, 0.0, -1.0)
                self._delivery_log.pages[source].append(HEAD(*sending.key) + verdict)
        return waited_s

    def _deliver_all(self, sending: Sending, near: InRange, delay_s: float) -> None:
        """Deliver a frame to all receivers in range, after the same delay [s]."""
        source, incarnation, channel, count = sending.key
        log_entry = WHOLE(source, incarnation, channel, count, 0, DELIVERED, delay_s, -1.0)
        due_s = sending.sent_s + delay_s
        entry: _InFlight = (due_s, source, incarnation, channel, count, 0, sending.frame)
        queues, pages = self._queues, self._delivery_log.pages
        for receiver, _ in near:
            queues[receiver].append(entry)
            pages[receiver].append(log_entry)
        self.in_flight += len(near)

    def _decide_plain(self, sending: Sending, near: InRange, link: LinkModel) -> None:
        """Decide the fate of a frame on links of one model that has only loss and jitter."""
        source, incarnation, channel, count = sending.key
        frame, sent_s = sending.frame, sending.sent_s
        head = HEAD(source, incarnation, channel, count)
        queues, pages = self._queues, self._delivery_log.pages
        fates, delivered = self._fates, 0
        verdicts = self._links.plain(link, sending, near)
        for k, (receiver, _) in enumerate(near):
            fate = verdicts[k]
            cause: int = fate.cause
            page = pages[receiver]
            page.append(head)
            page.append(FATE(0, cause, fate.delay_s, fate.flipped_at))
            if cause:
                fates[cause] += 1
            else:
                due_s = sent_s + fate.delay_s
                queues[receiver].append((due_s, source, incarnation, channel, count, 0, frame))
                delivered += 1
        self.in_flight += delivered

    def _decide_each(self, sending: Sending, near: InRange) -> None:
        """Decide the fate of a frame on each link by itself: models may differ, faults may cut."""
        source, _, channel, _ = sending.key
        head, links, models = HEAD(*sending.key), self._links, self._conditions.models
        obstructed = self._conditions.obstructed
        for receiver, distance_m in near:
            link = models.of_link(channel, source, receiver)
            if obstructed and self._is_cut(source, receiver, sending.sent_s):
                self._record(sending, head, receiver, LOST_TO_PARTITION)
            elif link.plain:
                fates = links.plain(link, sending, [(receiver, distance_m)])
                self._record(sending, head, receiver, fates[0])
            else:
                self._record_all(
                    sending, head, receiver, links.full(link, sending, receiver, distance_m)
                )

    def _record_all(
        self, sending: Sending, head: bytes, receiver: int, fates: list[Verdict]
    ) -> None:
        """Record the verdicts on a frame and on its duplicate; a duplicate adds to addressed."""
        for copy, fate in enumerate(fates):
            self._record(sending, head, receiver, fate, copy)
        self.addressed += len(fates) - 1
        self.duplicated += len(fates) - 1

    def _record(
        self, sending: Sending, head: bytes, receiver: int, fate: Verdict, copy: int = 0
    ) -> None:
        """Log and count a verdict; put a delivered frame into its receiver's queue."""
        delay_s, turned = fate.delay_s, fate.flipped_at
        verdict = FATE(copy, fate.cause, delay_s, turned)
        self._delivery_log.pages[receiver].append(head + verdict)
        if fate.cause:
            self._fates[fate.cause] += 1
            return
        frame = sending.frame
        if turned >= 0.0 and frame.payload:
            frame = _with_flipped_bit(frame, turned)
            self.corrupted += 1
        self._queues[receiver].append((sending.sent_s + delay_s, *sending.key, copy, frame))
        self.in_flight += 1

    def _is_cut(self, source: int, receiver: int, now_s: float) -> bool:
        """Return whether a fault cuts a directed link at a time [s], and count that for each."""
        positions = self._range_index.positions
        radios = (positions[source], positions[receiver])
        cutters = self._conditions.cutters(source, receiver, now_s, radios)
        for number in cutters:
            self._struck[number] = self._struck.get(number, 0) + 1
        return bool(cutters)


def _count_fitting(due: Sequence[_InFlight]) -> int:
    """Return how many of the frames that are due, from the first on, fit one batch."""
    room_b = MAX_BATCH_B - BATCH_HEAD_B
    for count, entry in enumerate(due[:MAX_FRAMES]):
        room_b -= FRAME_HEAD_B + len(entry[-1].payload)
        if room_b < 0:
            return count
    return min(len(due), MAX_FRAMES)


def _with_flipped_bit(frame: Frame, share: float) -> Frame:
    """Return a frame with one bit flipped, at a share of its payload's length in [0, 1)."""
    payload = bytearray(frame.payload)
    bit = int(share * 8 * len(payload))
    payload[bit // 8] ^= 1 << bit % 8
    return msgspec.structs.replace(frame, payload=bytes(payload))
