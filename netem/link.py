"""One directed link: whether a frame gets across, when, and whole or not.

``verdict`` is the whole law of a link: a function of the link's model, the distance, numbers drawn
for this very frame, and what the link remembers. So the same frame always meets the same fate.
"""

from dataclasses import dataclass, field
from enum import IntEnum
from math import inf, log10

import msgspec

from netem.link_keys import GilbertElliott, PathLoss
from netem.random_draws import SHAPES, SHARING, Numbers, below, correlated, draw, draw_shared, pair
from netem.range_index import Near
from netem.rate_queue import RateQueue
from netem.wire.frame import Frame

DEFAULT_LIMIT = 1000
"""tc-netem's own [frames]."""
EDGE_SIGMAS = 6.0
"""So far over the budget, in shadowing_db, nothing is received: one frame in 10^9 would be."""


class Cause(IntEnum):
    """What became of a frame on a link; the names are those of summary.json."""

    DELIVERED = 0
    DROPPED_RANGE = 1
    DROPPED_LOSS = 2
    DROPPED_MEDIUM = 3
    DROPPED_PARTITION = 4
    DROPPED_QUEUE = 5


class Verdict(msgspec.Struct, frozen=True, gc=False):
    """What a link decides: the cause, and the delay [s] of a frame that gets across.

    turned: which share of its bits along a frame one is that arrives wrong, in [0, 1); negative
    where the frame is whole.
    """

    cause: Cause
    delay_s: float = 0.0
    turned: float = -1.0


class Memory:
    """What one directed link remembers on one channel, from one of its frames to the next.

    bad: Gilbert-Elliott's state. score: the last delay's, a standard normal number; None before the
    first. air: what waits, where the link has a rate of its own.
    """

    __slots__ = ("air", "bad", "score")

    def __init__(self) -> None:
        self.bad = False
        self.score: float | None = None
        self.air = RateQueue()


@dataclass(frozen=True, slots=True)
class LinkModel:
    """A link in tc-netem's and ns-3's terms.

    range_m: hard disc, d_c [m]; infinite without a limit. path_loss: a soft edge within it.
    delay_ms, jitter_ms, distribution: the delay is delay + jitter * a number of that shape, never
    under 0 [ms]; delay_correlation_percent: how much it remembers of the frame before.
    loss_percent, gemodel: independent losses, and losses in bursts; a frame must pass both.
    duplicate_percent, corrupt_percent: come twice, come with a bit turned. reorder_percent: skip
    the delay, and so overtake.
    rate_kbit, rate_overhead_b, limit: how fast frames go out, with so many bytes more for each, and
    how many may wait [frames]. They are the sender's; ``own_air``: the link has its own.
    draws: whether a verdict on this link needs random numbers at all, ``plain``: for no more than
    loss and uniform jitter; ``clean``: the verdict in range if it needs none. remembers: whether it
    needs a Memory. reach_m: beyond it nothing is ever received.
    """

    range_m: float = inf
    delay_ms: float = 0.0
    jitter_ms: float = 0.0
    loss_percent: float = 0.0
    path_loss: PathLoss | None = None
    delay_correlation_percent: float = 0.0
    distribution: str = "uniform"
    gemodel: GilbertElliott | None = None
    duplicate_percent: float = 0.0
    corrupt_percent: float = 0.0
    reorder_percent: float = 0.0
    rate_kbit: float = inf
    rate_overhead_b: int = 0
    limit: int = DEFAULT_LIMIT
    own_rate: bool = False

    draws: bool = field(init=False)
    plain: bool = field(init=False)
    clean: Verdict = field(init=False)
    remembers: bool = field(init=False)
    reach_m: float = field(init=False)

    def __post_init__(self) -> None:
        rare = self.duplicate_percent + self.corrupt_percent + self.reorder_percent > 0.0
        shaped = self.delay_correlation_percent > 0.0 or self.distribution != "uniform"
        jittery = self.jitter_ms > 0.0
        bursts, soft = self.gemodel is not None, self.path_loss is not None
        plain = not (rare or bursts or soft or self.own_rate or (jittery and shaped))
        draws = jittery or self.loss_percent > 0.0 or not plain
        remembers = bursts or self.own_rate or (jittery and self.delay_correlation_percent > 0.0)
        object.__setattr__(self, "draws", draws)
        object.__setattr__(self, "plain", plain)
        object.__setattr__(self, "clean", Verdict(Cause.DELIVERED, self.delay_ms / 1000.0))
        object.__setattr__(self, "remembers", remembers)
        object.__setattr__(self, "reach_m", min(self.range_m, edge_m(self.path_loss)))


def mean_loss(link: LinkModel) -> float:
    """Return the share of frames that a link loses in the long run, in range."""
    kept = 1.0 - link.loss_percent / 100.0
    model = link.gemodel
    if model is not None:
        turns = model.p_percent + model.r_percent
        bad = model.p_percent / turns if turns > 0.0 else 0.0
        kept *= 1.0 - (bad * model.loss_bad_percent + (1.0 - bad) * model.loss_good_percent) / 100.0
    return 1.0 - kept


def stretch(link: LinkModel) -> float:
    """Return by how much bursts widen what is lost: (1 + rho) / (1 - rho), rho = 1 - p - r.

    The variance of the mean of a two-state chain against independent draws; 1 without bursts. With
    p + r = 0 the chain never moves: infinite.
    """
    if link.gemodel is None:
        return 1.0
    rho = 1.0 - (link.gemodel.p_percent + link.gemodel.r_percent) / 100.0
    return (1.0 + rho) / (1.0 - rho) if rho < 1.0 else inf


FRESH = Memory()
"""For links that remember nothing; never written to."""
LOST_TO_RANGE = Verdict(Cause.DROPPED_RANGE)
LOST = Verdict(Cause.DROPPED_LOSS)
LOST_TO_PARTITION = Verdict(Cause.DROPPED_PARTITION)
LOST_TO_QUEUE = Verdict(Cause.DROPPED_QUEUE)


def verdict(
    link: LinkModel, distance_m: float, draws: Numbers | None, memory: Memory = FRESH
) -> Verdict:
    """Decide one frame on one link.

    draws: numbers for loss and delay; unless ``link.plain`` also for edge, reorder, the step
    between good and bad, the loss in bursts, duplicate and corruption; None where ``link.draws`` is
    False. memory: the link's own, which changes, where ``link.remembers``.
    """
    if not distance_m <= link.range_m:
        return LOST_TO_RANGE
    if draws is None:
        return link.clean
    if not link.plain:
        return _rough(link, distance_m, draws, memory)
    if draws[0] * 100.0 < link.loss_percent:
        return LOST
    delay_ms = link.delay_ms + link.jitter_ms * (2.0 * draws[1] - 1.0)
    return Verdict(Cause.DELIVERED, delay_ms / 1000.0 if delay_ms > 0.0 else 0.0)


def _rough(link: LinkModel, distance_m: float, draws: Numbers, memory: Memory) -> Verdict:
    """Decide by all that a link may have beyond loss and jitter."""
    loss, delay, edge, reorder, step, burst, _, corrupt = draws
    if link.path_loss is not None and not edge < received(link.path_loss, distance_m):
        return LOST_TO_RANGE
    in_burst = link.gemodel is not None and _lost_in_burst(link.gemodel, step, burst, memory)
    if in_burst or loss * 100.0 < link.loss_percent:
        return LOST
    delay_s = _delay_ms(link, delay, memory) / 1000.0
    if reorder * 100.0 < link.reorder_percent:
        delay_s = 0.0
    if corrupt * 100.0 < link.corrupt_percent:
        return Verdict(Cause.DELIVERED, delay_s, corrupt * 100.0 / link.corrupt_percent)
    return Verdict(Cause.DELIVERED, delay_s)


def twice(link: LinkModel, draws: Numbers) -> bool:
    """Whether a frame is duplicated on a link."""
    return draws[6] * 100.0 < link.duplicate_percent


def _lost_in_burst(model: GilbertElliott, step: float, burst: float, memory: Memory) -> bool:
    """Decide by Gilbert and Elliott: the state a frame finds loses it, or not; then it steps."""
    if memory.bad:
        memory.bad = not step * 100.0 < model.r_percent
        return burst * 100.0 < model.loss_bad_percent
    memory.bad = step * 100.0 < model.p_percent
    return burst * 100.0 < model.loss_good_percent


def _delay_ms(link: LinkModel, share: float, memory: Memory) -> float:
    if link.jitter_ms <= 0.0:
        return link.delay_ms
    if link.delay_correlation_percent > 0.0:
        correlation = link.delay_correlation_percent / 100.0
        share, memory.score = correlated(share, memory.score, correlation)
    return max(0.0, link.delay_ms + link.jitter_ms * SHAPES[link.distribution](share))


def received(edge: PathLoss, distance_m: float) -> float:
    """Return the probability that a frame is received over a distance [m]."""
    far = max(1.0, distance_m / edge.reference_distance_m)
    loss_db = edge.reference_loss_db + 10.0 * edge.exponent * log10(far)
    return below((edge.budget_db - loss_db) / edge.shadowing_db)


def edge_m(edge: PathLoss | None) -> float:
    """Return the distance [m] beyond which a soft edge lets nothing through."""
    if edge is None:
        return inf
    room_db = edge.budget_db + EDGE_SIGMAS * edge.shadowing_db - edge.reference_loss_db
    decades = min(12.0, room_db / (10.0 * edge.exponent))
    return edge.reference_distance_m * 10.0**decades if room_db > 0.0 else 0.0


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
    if not link.own_rate:
        return _later(fate, sending.waited_s)
    size_b = len(sending.frame.payload) + link.rate_overhead_b
    waited_s = memory.air.enter(sending.sent_s, size_b, link.rate_kbit, link.limit)
    return LOST_TO_QUEUE if waited_s is None else _later(fate, waited_s)


def _later(fate: Verdict, waited_s: float) -> Verdict:
    """Return what happens to a frame that waits first [s]."""
    return Verdict(fate.cause, waited_s + fate.delay_s, fate.turned) if not fate.cause else fate
