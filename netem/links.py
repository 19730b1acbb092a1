"""All directed links: the numbers drawn for each frame, and what each link remembers.

A link's memory belongs to it and one channel, and moves on only with frames that get as far as the
link: in range, not barred, sent. They come in the order of their counts.
"""

import msgspec

from netem.link import FRESH, LOST_TO_QUEUE, LinkModel, Memory, Verdict, twice, verdict
from netem.random_draws import SHARING, draw, draw_shared, pair
from netem.range_index import Near
from netem.wire.frame import Frame


class Sending(msgspec.Struct, frozen=True, gc=False):
    """A frame on its way: its key, when it was sent, how long its sender's queue took [s]."""

    frame: Frame
    key: tuple[int, int, int, int]
    sent_s: float
    waited_s: float


class Links:
    """Verdicts link by link; ``seed``: 32 bytes."""

    def __init__(self, seed: bytes) -> None:
        self._seed = seed
        self._memories: dict[tuple[int, int, int], Memory] = {}

    def plain(self, link: LinkModel, sending: Sending, near: Near) -> list[Verdict]:
        """Decide on links that are no more than late and lossy, all alike, in order of near."""
        if not link.draws:
            return [
                _later(verdict(link, distance_m, None), sending.waited_s) for _, distance_m in near
            ]
        source, incarnation, channel, count = sending.key
        fates: list[Verdict] = []
        shared, group = b"", -1
        for receiver, distance_m in near:
            if receiver // SHARING != group:
                group = receiver // SHARING
                shared = draw_shared(self._seed, source, incarnation, group, channel, count)
            fates.append(verdict(link, distance_m, pair(shared, receiver)))
        waited_s = sending.waited_s
        return [_later(fate, waited_s) for fate in fates] if waited_s else fates

    def rough(
        self, link: LinkModel, sending: Sending, receiver: int, distance_m: float
    ) -> list[Verdict]:
        """Decide on any link: for the frame, and for its copy where it is duplicated."""
        source, incarnation, channel, count = sending.key
        memory = FRESH
        if link.remembers:
            memory = self._memories.setdefault((source, receiver, channel), Memory())
        fates: list[Verdict] = []
        copies = 1
        while len(fates) < copies:
            purpose = 1 + len(fates)
            draws = draw(self._seed, source, incarnation, receiver, channel, count, purpose)
            copies = 2 if twice(link, draws) or fates else 1
            fate = verdict(link, distance_m, draws, memory)
            fates.append(_through(link, memory, sending, fate))
        return fates


def _through(link: LinkModel, memory: Memory, sending: Sending, fate: Verdict) -> Verdict:
    """Let a frame that gets across wait as long as it must."""
    if fate.cause:
        return fate
    if not link.own_air:
        return _later(fate, sending.waited_s)
    size_b = len(sending.frame.payload) + link.rate_overhead_b
    waited_s = memory.air.enter(sending.sent_s, size_b, link.rate_kbit, link.limit)
    return LOST_TO_QUEUE if waited_s is None else _later(fate, waited_s)


def _later(fate: Verdict, waited_s: float) -> Verdict:
    """Return what happens to a frame that waits first [s]."""
    return Verdict(fate.cause, waited_s + fate.delay_s, fate.turned) if not fate.cause else fate
