"""The radio medium: every frame in flight, and what became of every frame.

A pure state machine. Time enters with the true positions (``place``); each transmission is judged
once, link by link, when it is sent; ``collect`` hands a receiver what came due. The order of
deliveries is canonical, (due, source, incarnation, channel, count), so it does not depend on the
order in which transmissions arrived.
"""

from hashlib import sha256
from heapq import heappop, heappush
from math import nan, sqrt
from struct import Struct as Layout

from netem.link import LOST_TO_PARTITION, Cause, draw, verdict
from netem.messages import (
    Changed,
    Conditions,
    Groups,
    Healed,
    MediumSetup,
    Parted,
    Position,
    RadioOrder,
    Verdicts,
)
from netem.schedule import Schedule
from netem.wire.frame import (
    BATCH_HEAD_B,
    FRAME_HEAD_B,
    MAX_BATCH_B,
    MAX_FRAMES,
    Frame,
    Transmission,
)

_FATE = Layout("<5qBd").pack
DELIVERED = Cause.DELIVERED
FATES = tuple(cause.name.lower() for cause in Cause)
_InFlight = tuple[float, int, int, int, int, Frame]


class Medium:
    """Frames between agents under a seed and conditions.

    Conservation, at every moment: ``addressed`` (frames sent, times the other agents, whether they
    are there or not) equals the sum of all fates plus what is in flight. A frame for a radio that
    is not there is out of range; what is in flight to one that goes is dropped by the medium.
    """

    def __init__(self, setup: MediumSetup) -> None:
        self._seed = sha256(b"qswarm medium %d" % setup.seed).digest()
        self._schedule = Schedule(setup.conditions)
        self._agents = setup.agents
        self._positions: tuple[Position | None, ...] = (None,) * setup.agents
        self._queues: list[list[_InFlight]] = [[] for _ in range(setup.agents)]
        self._counts: dict[tuple[int, int, int], int] = {}
        self._fates = [0] * len(Cause)
        self._journal = sha256()
        self.sent = 0
        self.in_flight = 0

    @property
    def addressed(self) -> int:
        """How many (frame, other agent) pairs there were so far."""
        return self.sent * (self._agents - 1)

    def place(self, positions: tuple[Position | None, ...]) -> None:
        """Take the true positions, row i = agent i [m; world frame]; None where no radio is."""
        self._positions = positions
        if None in positions:
            for receiver, where in enumerate(positions):
                if where is None and self._queues[receiver]:
                    self.discard(receiver)

    def obey(self, order: RadioOrder) -> None:
        """Carry out an order, between slots."""
        match order:
            case Changed(conditions=conditions):
                self.change(conditions)
            case Parted(groups=groups):
                self.partition(groups)
            case Healed():
                self.heal()

    def change(self, conditions: Conditions) -> None:
        """Judge later frames under other conditions; what is in flight has its verdict."""
        self._schedule.change(conditions)

    def partition(self, groups: Groups) -> None:
        """Let no later frame across between groups; agents not named form one group more."""
        self._schedule.partition(groups)

    def heal(self) -> None:
        """Let later frames across again."""
        self._schedule.heal()

    def transmit(self, source: int, sent_s: float, transmission: Transmission) -> None:
        """Judge one agent's frames of one slot, sent at ``sent_s`` [s], on every link."""
        for outgoing in transmission.frames:
            count_key = (source, transmission.incarnation, outgoing.channel)
            count = self._counts.get(count_key, 0)
            self._counts[count_key] = count + 1
            self.sent += 1
            self._spread(
                Frame(source, transmission.incarnation, outgoing.channel, count, outgoing.payload),
                sent_s,
            )

    def collect(self, receiver: int, now_s: float) -> tuple[Frame, ...]:
        """Return, and forget, the frames that came due for one receiver by ``now_s`` [s].

        No more than fit one batch: what is over stays in flight, and comes first the next time.
        """
        queue = self._queues[receiver]
        frames: list[Frame] = []
        room_b = MAX_BATCH_B - BATCH_HEAD_B
        while queue and queue[0][0] <= now_s and len(frames) < MAX_FRAMES:
            room_b -= FRAME_HEAD_B + len(queue[0][-1].payload)
            if room_b < 0:
                break
            frames.append(heappop(queue)[-1])
        self.in_flight -= len(frames)
        self._fates[Cause.DELIVERED] += len(frames)
        return tuple(frames)

    def discard(self, receiver: int) -> None:
        """Drop what is in flight to a receiver that is no longer there."""
        lost = len(self._queues[receiver])
        self._queues[receiver].clear()
        self.in_flight -= lost
        self._fates[Cause.DROPPED_MEDIUM] += lost

    def digest(self) -> bytes:
        """Return a hash over every verdict so far, in canonical order within a transmission."""
        return self._journal.digest()

    def verdicts(self, slot: int) -> Verdicts:
        """Return the counters as they stand."""
        fates = dict(zip(FATES, self._fates, strict=True))
        return Verdicts(slot, self.sent, self.addressed, fates, self.in_flight, {}, self.digest())

    def _spread(self, frame: Frame, sent_s: float) -> None:
        """Judge one frame on its link to every other agent, in order of their ids."""
        source, incarnation, channel, count = (
            frame.source,
            frame.incarnation,
            frame.channel,
            frame.count,
        )
        here, schedule = self._positions[source], self._schedule
        journal = []
        for receiver, there in enumerate(self._positions):
            if receiver == source:
                continue
            link = schedule.model(channel, source, receiver)
            distance_m = _distance(here, there) if here and there else nan
            draws = None
            if link.draws:
                draws = draw(self._seed, source, incarnation, receiver, channel, count)
            cause, delay_s = verdict(link, distance_m, draws)
            if schedule.parted and schedule.cut(source, receiver):
                cause, delay_s = LOST_TO_PARTITION
            journal.append(_FATE(source, incarnation, receiver, channel, count, cause, delay_s))
            if cause is DELIVERED:
                order = (sent_s + delay_s, source, incarnation, channel, count, frame)
                heappush(self._queues[receiver], order)
                self.in_flight += 1
            else:
                self._fates[cause] += 1
        self._journal.update(b"".join(journal))


def _distance(a: Position, b: Position) -> float:
    dx, dy, dz = a[0] - b[0], a[1] - b[1], a[2] - b[2]
    return sqrt(dx * dx + dy * dy + dz * dz)
