"""One directed link: whether a frame gets across, when, and with which damage.

``plain_verdict`` and ``full_verdict`` are the whole law of a link: functions of its model, the
distance, the numbers drawn for this frame, and the link's state. The same frame always gets the
same verdict.
"""

from dataclasses import dataclass
from enum import IntEnum
from math import inf, log10
from typing import Final, final

from netem.link_model import LinkModel
from netem.link_parameters import GilbertElliott, PathLoss
from netem.random_draws import (
    GROUP_SIZE,
    SHAPES,
    FrameDraws,
    PlainDraws,
    Purpose,
    correlated_share,
    draw,
    draw_group,
    normal_cdf,
    plain_draws,
)
from netem.range_index import InRange
from netem.rate_queue import RateQueue
from netem.wire.frame import Frame


class Cause(IntEnum):
    """What became of a frame on a link; the names are those of summary.json."""

    DELIVERED = 0
    DROPPED_RANGE = 1
    DROPPED_LOSS = 2
    DROPPED_MEDIUM = 3
    DROPPED_PARTITION = 4
    DROPPED_QUEUE = 5


@final
@dataclass(init=False)
class Verdict:
    """What a link decides about one frame."""

    cause: Cause
    delay_s: float
    """Delay of a frame that is delivered, with its wait in the sender's queue [s]."""
    flipped_at: float
    """Place of the flipped bit, as a share of the payload's bits in [0, 1); -1 for none."""

    def __init__(self, cause: Cause, delay_s: float = 0.0, flipped_at: float = -1.0) -> None:
        self.cause = cause
        self.delay_s = delay_s
        self.flipped_at = flipped_at


class LinkState:
    """What one directed link keeps on one channel from one of its frames to the next."""

    __slots__ = ("bad", "jitter_score", "queue")

    def __init__(self) -> None:
        self.bad = False
        """The Gilbert-Elliott state."""
        self.jitter_score: float | None = None
        """Normal score of the last frame's jitter; None before the first frame."""
        self.queue = RateQueue()
        """Frames that wait, where the link has a rate of its own."""


def mean_loss(link: LinkModel) -> float:
    """Return the share of frames that a link loses in the long run, within range."""
    kept = 1.0 - link.loss_percent / 100.0
    model = link.gemodel
    if model is not None:
        turns = model.p_percent + model.r_percent
        bad = model.p_percent / turns if turns > 0.0 else 0.0
        kept *= 1.0 - (bad * model.loss_bad_percent + (1.0 - bad) * model.loss_good_percent) / 100.0
    return 1.0 - kept


def unusable_share(link: LinkModel, distance_m: float) -> float:
    """Return the share of frames of which a receiver has no use, in the long run.

    They are lost over this distance [m], or arrive corrupted.
    """
    if not distance_m <= link.reach_m:
        return 1.0
    usable = (1.0 - mean_loss(link)) * (1.0 - link.corrupt_percent / 100.0)
    if link.path_loss is not None:
        usable *= reception_probability(link.path_loss, distance_m)
    return 1.0 - usable


def burst_variance_factor(link: LinkModel) -> float:
    """Return by how much bursts raise the variance of the mean loss over independent losses.

    (1 + rho) / (1 - rho) with rho = 1 - p - r, for a two-state chain; 1 without bursts; infinite
    for p + r = 0, where the state never changes.
    """
    if link.gemodel is None:
        return 1.0
    rho = 1.0 - (link.gemodel.p_percent + link.gemodel.r_percent) / 100.0
    return (1.0 + rho) / (1.0 - rho) if rho < 1.0 else inf


NO_STATE: Final = LinkState()
"""For links that keep no state; never written to."""
LOST_TO_RANGE: Final = Verdict(Cause.DROPPED_RANGE)
LOST: Final = Verdict(Cause.DROPPED_LOSS)
LOST_TO_PARTITION: Final = Verdict(Cause.DROPPED_PARTITION)
LOST_TO_QUEUE: Final = Verdict(Cause.DROPPED_QUEUE)


@final
class PlainLaw:
    """The law of a ``plain`` link, whose numbers are read once for all receivers of a frame."""

    def __init__(self, link: LinkModel) -> None:
        self._range_m: float = link.range_m
        self._loss_percent: float = link.loss_percent
        self._delay_ms: float = link.delay_ms
        self._jitter_ms: float = link.jitter_ms
        self._clean_delay_s: float = link.clean_delay_s

    def verdict(self, distance_m: float, draws: PlainDraws | None) -> Verdict:
        """Decide one frame; draws: None where the link's ``draws`` is False."""
        if not distance_m <= self._range_m:
            return LOST_TO_RANGE
        if draws is None:
            return Verdict(Cause.DELIVERED, self._clean_delay_s)
        if draws.loss * 100.0 < self._loss_percent:
            return LOST
        delay_ms = self._delay_ms + self._jitter_ms * (2.0 * draws.delay - 1.0)
        return Verdict(Cause.DELIVERED, delay_ms / 1000.0 if delay_ms > 0.0 else 0.0)


def plain_verdict(link: LinkModel, distance_m: float, draws: PlainDraws | None) -> Verdict:
    """Decide one frame on a ``plain`` link; draws: None where ``link.draws`` is False."""
    return PlainLaw(link).verdict(distance_m, draws)


def full_verdict(
    link: LinkModel, distance_m: float, draws: FrameDraws, state: LinkState = NO_STATE
) -> Verdict:
    """Decide one frame on any link; state: the link's own, which is updated."""
    if not distance_m <= link.range_m:
        return LOST_TO_RANGE
    edge = link.path_loss
    if edge is not None and not draws.path_loss < reception_probability(edge, distance_m):
        return LOST_TO_RANGE
    in_burst = link.gemodel is not None and _lost_in_burst(link.gemodel, draws, state)
    if in_burst or draws.loss * 100.0 < link.loss_percent:
        return LOST
    delay_s = _delay_ms(link, draws.delay, state) / 1000.0
    if draws.reorder * 100.0 < link.reorder_percent:
        delay_s = 0.0
    if draws.corruption * 100.0 < link.corrupt_percent:
        flipped_at = draws.corruption * 100.0 / link.corrupt_percent
        return Verdict(Cause.DELIVERED, delay_s, flipped_at)
    return Verdict(Cause.DELIVERED, delay_s)


def is_duplicated(link: LinkModel, draws: FrameDraws) -> bool:
    """Whether a link delivers a copy of a frame besides the frame."""
    return draws.duplicate * 100.0 < link.duplicate_percent


def _lost_in_burst(model: GilbertElliott, draws: FrameDraws, state: LinkState) -> bool:
    """Decide by the state that the frame finds; then step the state (Gilbert and Elliott)."""
    if state.bad:
        state.bad = not draws.state_step * 100.0 < model.r_percent
        return draws.burst_loss * 100.0 < model.loss_bad_percent
    state.bad = draws.state_step * 100.0 < model.p_percent
    return draws.burst_loss * 100.0 < model.loss_good_percent


def _delay_ms(link: LinkModel, share: float, state: LinkState) -> float:
    if link.jitter_ms <= 0.0:
        return link.delay_ms
    if link.delay_correlation_percent > 0.0:
        correlation = link.delay_correlation_percent / 100.0
        share, state.jitter_score = correlated_share(share, state.jitter_score, correlation)
    return max(0.0, link.delay_ms + link.jitter_ms * SHAPES[link.distribution](share))


def reception_probability(edge: PathLoss, distance_m: float) -> float:
    """Return the probability that a frame is received over a distance [m]."""
    far = max(1.0, distance_m / edge.reference_distance_m)
    loss_db = edge.reference_loss_db + 10.0 * edge.exponent * log10(far)
    return normal_cdf((edge.budget_db - loss_db) / edge.shadowing_db)


@final
class Sending:
    """A frame that its sender has sent.

    key: the frame's source, incarnation, channel and count. sent_s: simulated time at which it was
    sent [s]. waited_s: time in its sender's queue and on the air [s].
    """

    def __init__(
        self, frame: Frame, key: tuple[int, int, int, int], sent_s: float, waited_s: float
    ) -> None:
        self.frame = frame
        self.key = key
        self.sent_s = sent_s
        self.waited_s = waited_s


class Links:
    """All links of a medium, with their states; seed: 32 bytes."""

    def __init__(self, seed: bytes) -> None:
        self._seed = seed
        self._states: dict[tuple[int, int, int], LinkState] = {}
        self._law: PlainLaw | None = None
        """Of the frame decided last."""
        self._law_of: LinkModel | None = None

    def redraw(self, seed: bytes) -> None:
        """Draw every later frame's numbers from another seed (32 bytes); states stay."""
        self._seed = seed

    def plain(self, link: LinkModel, sending: Sending, in_range: InRange) -> list[Verdict]:
        """Decide a frame for all receivers in range, whose links are alike and plain; in order."""
        law = self._law_for(link)
        if not link.draws:
            return [
                _delayed(law.verdict(distance_m, None), sending.waited_s)
                for _, distance_m in in_range
            ]
        verdicts: list[Verdict] = []
        group_draw, group = b"", -1
        for k, (receiver, distance_m) in enumerate(in_range):
            if receiver // GROUP_SIZE != group:
                group = receiver // GROUP_SIZE
                last = _last_of_group(in_range, k)
                group_draw = draw_group(self._seed, sending.frame, group, last)
            draws = plain_draws(group_draw, receiver)
            verdicts.append(law.verdict(distance_m, draws))
        waited_s = sending.waited_s
        return [_delayed(verdict, waited_s) for verdict in verdicts] if waited_s else verdicts

    def _law_for(self, link: LinkModel) -> PlainLaw:
        """Return the law of a plain link: mostly that of the last frame."""
        law = self._law
        if law is None or link is not self._law_of:
            law = PlainLaw(link)
            self._law, self._law_of = law, link
        return law

    def full(
        self, link: LinkModel, sending: Sending, receiver: int, distance_m: float
    ) -> list[Verdict]:
        """Decide a frame on any link; the second verdict, if there is one, is for its copy."""
        source, _, channel, _ = sending.key
        state = NO_STATE
        if link.remembers:
            state = self._states.setdefault((source, receiver, channel), LinkState())
        draws = draw(self._seed, sending.frame, receiver, Purpose.FRAME)
        verdicts = [_queued(link, state, sending, full_verdict(link, distance_m, draws, state))]
        if is_duplicated(link, draws):
            draws = draw(self._seed, sending.frame, receiver, Purpose.COPY)
            copy = full_verdict(link, distance_m, draws, state)
            verdicts.append(_queued(link, state, sending, copy))
        return verdicts


def _last_of_group(in_range: InRange, begin: int) -> int:
    """Return the last receiver that draws with the one at an index."""
    last, _ = in_range[begin]
    group = last // GROUP_SIZE
    for k in range(begin + 1, len(in_range)):
        receiver, _ = in_range[k]
        if receiver // GROUP_SIZE != group:
            break
        last = receiver
    return last


def _queued(link: LinkModel, state: LinkState, sending: Sending, verdict: Verdict) -> Verdict:
    """Return a verdict with the wait in the link's own queue, or in the sender's, added."""
    if verdict.cause:
        return verdict
    if not link.own_rate:
        return _delayed(verdict, sending.waited_s)
    size_b = len(sending.frame.payload) + link.rate_overhead_b
    waited_s = state.queue.enter(sending.sent_s, size_b, link.rate_kbit, link.limit)
    return LOST_TO_QUEUE if waited_s is None else _delayed(verdict, waited_s)


def _delayed(verdict: Verdict, waited_s: float) -> Verdict:
    """Return a verdict with a wait [s] added where the frame is delivered."""
    if verdict.cause:
        return verdict
    return Verdict(verdict.cause, waited_s + verdict.delay_s, verdict.flipped_at)
