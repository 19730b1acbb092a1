"""One directed link: whether a frame gets across, and when.

``verdict`` is the whole law of a link. It is a pure function of the link's model, the distance and
numbers drawn for this very frame, so the same frame always meets the same fate.
"""

from dataclasses import dataclass, field
from enum import IntEnum
from hashlib import blake2b
from struct import Struct as Layout
from typing import NamedTuple


class Cause(IntEnum):
    """What became of a frame on a link; the names are those of summary.json."""

    DELIVERED = 0
    DROPPED_RANGE = 1
    DROPPED_LOSS = 2
    DROPPED_MEDIUM = 3
    DROPPED_PARTITION = 4


class Verdict(NamedTuple):
    """What a link decides: the cause, and the delay [s] of a frame that gets across."""

    cause: Cause
    delay_s: float = 0.0


@dataclass(frozen=True, slots=True)
class LinkModel:
    """A link in tc-netem's and ns-3's terms.

    range_m: hard disc, d_c [m]; infinite without a limit.
    delay_ms, jitter_ms: delay is uniform in [delay - jitter, delay + jitter], never under 0 [ms].
    loss_percent: independent loss of each frame [%].
    draws: whether a verdict on this link needs random numbers at all; ``clean``: the verdict in
    range if it needs none.
    """

    range_m: float = float("inf")
    delay_ms: float = 0.0
    jitter_ms: float = 0.0
    loss_percent: float = 0.0

    draws: bool = field(init=False)
    clean: Verdict = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "draws", self.jitter_ms > 0.0 or self.loss_percent > 0.0)
        object.__setattr__(self, "clean", Verdict(Cause.DELIVERED, self.delay_ms / 1000.0))


_KEY = Layout("<6q")
_NUMBERS = Layout("<4Q")
_UNIT = 1.0 / 2**53


def draw(
    seed: bytes, source: int, incarnation: int, destination: int, channel: int, count: int
) -> tuple[float, float, float, float]:
    """Return four numbers in [0, 1) that belong to one frame on one link and to nothing else.

    They are keyed, not drawn in sequence: order, process and shard do not matter. By purpose:
    loss, jitter, and two that are not used yet.
    """
    key = _KEY.pack(source, incarnation, destination, channel, count, 0)
    a, b, c, d = _NUMBERS.unpack(blake2b(key, key=seed, digest_size=32).digest())
    return (a >> 11) * _UNIT, (b >> 11) * _UNIT, (c >> 11) * _UNIT, (d >> 11) * _UNIT


LOST_TO_RANGE = Verdict(Cause.DROPPED_RANGE)
LOST = Verdict(Cause.DROPPED_LOSS)
LOST_TO_PARTITION = Verdict(Cause.DROPPED_PARTITION)


def verdict(
    link: LinkModel, distance_m: float, draws: tuple[float, float, float, float] | None
) -> Verdict:
    """Decide one frame on one link; ``draws`` may be None where ``link.draws`` is False."""
    if not distance_m <= link.range_m:
        return LOST_TO_RANGE
    if draws is None:
        return link.clean
    if draws[0] * 100.0 < link.loss_percent:
        return LOST
    delay_ms = link.delay_ms + link.jitter_ms * (2.0 * draws[1] - 1.0)
    return Verdict(Cause.DELIVERED, max(0.0, delay_ms) / 1000.0)
