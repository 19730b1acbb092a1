"""The radio medium: every frame in flight, and what became of every frame.

A pure state machine. Time enters with the true positions (``place``); each transmission is judged
once, link by link, when it is sent; ``collect`` hands a receiver what came due. The order of
deliveries is canonical, (due, source, incarnation, channel, count, copy), so it does not depend on
the order in which transmissions arrived.
"""

from bisect import bisect_right
from collections.abc import Iterable, Mapping, Sequence
from hashlib import sha256
from math import inf

import msgspec

from netem.conditions import NetworkConditions
from netem.delivery_log import FATE, HEAD, DeliveryLog
from netem.faults import FaultOrder, Position
from netem.link import (
    LOST_TO_PARTITION,
    LOST_TO_QUEUE,
    Cause,
    LinkModel,
    Links,
    Sending,
    Verdict,
)
from netem.messages import MediumCounters, MediumSetup, packets_of
from netem.range_index import InRange, RangeIndex
from netem.rate_queue import RateQueue
from netem.wire.channels import CHANNELS, MAX_PAYLOAD_B
from netem.wire.frame import (
    BATCH_HEAD_B,
    FRAME_HEAD_B,
    MAX_BATCH_B,
    MAX_FRAMES,
    Frame,
    Transmission,
)

DELIVERED = Cause.DELIVERED
FATES = tuple(cause.name.lower() for cause in Cause)
SURELY_FIT = (MAX_BATCH_B - BATCH_HEAD_B) // (FRAME_HEAD_B + MAX_PAYLOAD_B)
"""So many frames fit one batch however long they are."""
_InFlight = tuple[float, int, int, int, int, int, Frame]


class Medium:
    """Frames between agents under a seed and conditions.

    receivers: those whom this medium delivers to, all when left out; several mediums that share
    them out, and all hear of every transmission, decide together what one would.

    Conservation, at every moment: ``addressed`` (frames sent, times the other agents, whether they
    are there or not, and each duplicate once more) equals the sum of all fates plus what is in
    flight. A frame for a radio that is not there is out of range; what is in flight to one that
    goes is dropped by the medium.
    """

    def __init__(self, setup: MediumSetup, receivers: Iterable[int] | None = None) -> None:
        own = tuple(sorted(range(setup.agents) if receivers is None else receivers))
        self._own = frozenset(own)
        self._links = Links(sha256(b"qswarm medium %d" % setup.seed).digest())
        self._conditions = NetworkConditions(setup.conditions)
        self._range_index = RangeIndex(setup.agents, own)
        self._others = [len(own) - (agent in self._own) for agent in range(setup.agents)]
        self._queues: list[list[_InFlight]] = [[] for _ in range(setup.agents)]
        self._counts: dict[tuple[int, int, int], int] = {}
        self._rate_queues: dict[tuple[int, int], RateQueue] = {}
        self._fates = [0] * len(Cause)
        self._delivery_log = DeliveryLog(setup.agents)
        self._spoken_b = [0] * (len(CHANNELS) * setup.agents)
        self.sent = self.addressed = self.in_flight = self.duplicated = self.corrupted = 0

    def place(self, positions: tuple[Position | None, ...]) -> None:
        """Take the true positions, row i = agent i [m; world frame]; None where no radio is."""
        self._range_index.place(positions)
        if None in positions:
            for receiver, where in enumerate(positions):
                if where is None and self._queues[receiver]:
                    self.discard(receiver)

    def obey(self, order: FaultOrder) -> None:
        """Begin or end a fault, between slots: it meets later frames, not those in flight."""
        self._conditions.apply(order)

    def transmit(self, source: int, sent_s: float, transmission: Transmission) -> None:
        """Judge one agent's frames of one slot, sent at ``sent_s`` [s], on every link."""
        for outgoing in transmission.frames:
            count_key = (source, transmission.incarnation, outgoing.channel)
            count = self._counts.get(count_key, 0)
            self._counts[count_key] = count + 1
            self.sent += 1
            self._spoken_b[len(CHANNELS) * source + outgoing.channel] += len(outgoing.payload)
            self.addressed += self._others[source]
            self._spread(
                Frame(source, transmission.incarnation, outgoing.channel, count, outgoing.payload),
                sent_s,
            )

    def collect(
        self, receiver: int, now_s: float, due_s: list[float] | None = None
    ) -> tuple[Frame, ...]:
        """Return, and forget, the frames that came due for one receiver by ``now_s`` [s].

        No more than fit one batch: what is over stays in flight, and comes first the next time.
        due_s: a list to which is added when each of them was due [s].
        """
        queue = self._queues[receiver]
        queue.sort()
        count = bisect_right(queue, (now_s, inf))
        if count > SURELY_FIT:
            count = _fitting(queue[:count])
        taken = queue[:count]
        del queue[:count]
        if due_s is not None:
            due_s.extend([entry[0] for entry in taken])
        self.in_flight -= count
        self._fates[Cause.DELIVERED] += count
        return tuple([entry[-1] for entry in taken])

    def discard(self, receiver: int) -> None:
        """Drop what is in flight to a receiver that is no longer there."""
        lost = len(self._queues[receiver])
        self._queues[receiver].clear()
        self.in_flight -= lost
        self._fates[Cause.DROPPED_MEDIUM] += lost

    def digest(self) -> bytes:
        """Return a hash over every verdict so far; asked at the end of each slot, it is one."""
        return self._delivery_log.digest()

    def pages(self) -> Mapping[int, bytes]:
        """Return, at the end of a slot, what a shard noted in it; see ``joined_pages``."""
        return self._delivery_log.take_pages()

    def packets(self) -> dict[str, int]:
        """Return the counters of packets under their names in summary.json."""
        fates = dict(zip(FATES, self._fates, strict=True))
        return packets_of(
            self.sent, self.addressed, fates, self.duplicated, self.corrupted, self.in_flight
        )

    def counters(self, slot: int) -> MediumCounters:
        """Return the counters as they stand."""
        return MediumCounters(
            slot,
            self.sent,
            self.addressed,
            dict(zip(FATES, self._fates, strict=True)),
            self.in_flight,
            {},
            self.digest(),
            duplicated=self.duplicated,
            corrupted=self.corrupted,
            spoken_b=tuple(self._spoken_b),
        )

    def _spread(self, frame: Frame, sent_s: float) -> None:
        """Judge one frame on its link to every other agent, in order of their ids."""
        source, channel, models = frame.source, frame.channel, self._conditions.models
        key = (source, frame.incarnation, channel, frame.count)
        sending = Sending(frame, key, sent_s, 0.0)
        sender = models.of_channel(channel)
        if sender.rate_kbit < inf:
            waited_s = self._queued(sending, sender)
            if waited_s is None:
                return
            sending = Sending(frame, key, sent_s, waited_s)
        near = self._range_index.in_range(source, models.reach_m(channel, source))
        self._fates[Cause.DROPPED_RANGE] += self._others[source] - len(near)
        alike = models.common(channel, source)
        if alike is None or not alike.plain or self._conditions.obstructed:
            self._cross(sending, near)
        elif alike.draws:
            self._cross_plain(sending, near, alike)
        else:
            self._cross_clean(sending, near, sending.waited_s + alike.clean.delay_s)

    def _queued(self, sending: Sending, sender: LinkModel) -> float | None:
        """Return how long the sender's channel takes [s]; None, and noted, where it is full."""
        source, _, channel, _ = sending.key
        air = self._rate_queues.setdefault((source, channel), RateQueue())
        size_b = len(sending.frame.payload) + sender.rate_overhead_b
        waited_s = air.enter(sending.sent_s, size_b, sender.rate_kbit, sender.limit)
        if waited_s is None:
            self._fates[Cause.DROPPED_QUEUE] += self._others[source]
            if source in self._own:
                self._delivery_log.pages[source] += HEAD(*sending.key) + FATE(
                    0, LOST_TO_QUEUE.cause, 0.0, -1.0
                )
        return waited_s

    def _cross_clean(self, sending: Sending, near: InRange, delay_s: float) -> None:
        """Deliver a frame to all who are near, after the same delay [s]."""
        frame, key, sent_s = sending.frame, sending.key, sending.sent_s
        noted = HEAD(*key) + FATE(0, DELIVERED, delay_s, -1.0)
        entry = (sent_s + delay_s, *key, 0, frame)
        queues, pages = self._queues, self._delivery_log.pages
        for receiver, _ in near:
            queues[receiver].append(entry)
            pages[receiver] += noted
        self.in_flight += len(near)

    def _cross_plain(self, sending: Sending, near: InRange, link: LinkModel) -> None:
        """Judge a frame on links that are all alike, and no more than late and lossy."""
        frame, key, sent_s = sending.frame, sending.key, sending.sent_s
        head, queues, pages = HEAD(*key), self._queues, self._delivery_log.pages
        lost = self._fates
        across = 0
        for (receiver, _), fate in zip(near, self._links.plain(link, sending, near), strict=True):
            pages[receiver] += head + FATE(0, fate.cause, fate.delay_s, fate.flipped_at)
            if fate.cause:
                lost[fate.cause] += 1
            else:
                queues[receiver].append((sent_s + fate.delay_s, *key, 0, frame))
                across += 1
        self.in_flight += across

    def _cross(self, sending: Sending, near: InRange) -> None:
        """Judge a frame on each link to those in reach."""
        source, _, channel, _ = sending.key
        head, links, models = HEAD(*sending.key), self._links, self._conditions.models
        obstructed = self._conditions.obstructed
        for receiver, distance_m in near:
            link = models.of_link(channel, source, receiver)
            if obstructed and self._is_cut(source, receiver, sending.sent_s):
                self._note(sending, head, receiver, LOST_TO_PARTITION)
            elif link.plain:
                fates = links.plain(link, sending, [(receiver, distance_m)])
                self._note(sending, head, receiver, fates[0])
            else:
                self._note_all(
                    sending, head, receiver, links.full(link, sending, receiver, distance_m)
                )

    def _note_all(self, sending: Sending, head: bytes, receiver: int, fates: list[Verdict]) -> None:
        """Enter the verdicts on a frame and on its copy, which counts as one more sent."""
        for copy, fate in enumerate(fates):
            self._note(sending, head, receiver, fate, copy)
        self.addressed += len(fates) - 1
        self.duplicated += len(fates) - 1

    def _note(
        self, sending: Sending, head: bytes, receiver: int, fate: Verdict, copy: int = 0
    ) -> None:
        """Enter a verdict in the books, and a frame that gets across in its receiver's queue."""
        delay_s, turned = fate.delay_s, fate.flipped_at
        self._delivery_log.pages[receiver] += head + FATE(copy, fate.cause, delay_s, turned)
        if fate.cause:
            self._fates[fate.cause] += 1
            return
        frame = sending.frame
        if turned >= 0.0 and frame.payload:
            frame = _turned(frame, turned)
            self.corrupted += 1
        self._queues[receiver].append((sending.sent_s + delay_s, *sending.key, copy, frame))
        self.in_flight += 1

    def _is_cut(self, source: int, receiver: int, now_s: float) -> bool:
        """Return whether a fault keeps two radios apart at a time [s]."""
        ends = (self._range_index.positions[source], self._range_index.positions[receiver])
        return self._conditions.cuts(source, receiver, now_s) or any(
            where is not None and self._conditions.jammed(where) for where in ends
        )


def _fitting(due: Sequence[_InFlight]) -> int:
    """Return how many of the frames that are due fit one batch, the first ones first."""
    room_b = MAX_BATCH_B - BATCH_HEAD_B
    for count, entry in enumerate(due[:MAX_FRAMES]):
        room_b -= FRAME_HEAD_B + len(entry[-1].payload)
        if room_b < 0:
            return count
    return min(len(due), MAX_FRAMES)


def _turned(frame: Frame, share: float) -> Frame:
    """Return a frame with the bit turned that stands at a share of its payload, in [0, 1)."""
    payload = bytearray(frame.payload)
    bit = int(share * 8 * len(payload))
    payload[bit // 8] ^= 1 << bit % 8
    return msgspec.structs.replace(frame, payload=bytes(payload))
