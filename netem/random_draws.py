"""Random numbers for frames, and the shapes of delay distributions.

Numbers are keyed, not drawn in sequence: each belongs to one frame, link and purpose, so the order
of frames, the process and the shard do not matter. Each number has a name (``FrameDraws``).

A shape is the quantile function of tc-netem's table of the same name, in standard deviations, as
iproute2 computes the table: jitter_ms times its value is added to delay_ms. The uniform shape is
netem's own default, from -1 to 1.
"""

from collections.abc import Callable
from dataclasses import dataclass
from enum import IntEnum
from hashlib import blake2b, shake_128
from math import erfc, pow, sqrt
from statistics import NormalDist
from struct import Struct as Layout
from typing import Final, final

from netem.wire.frame import Frame

MAX_QUANTILE: Final = 32767.0 / 8192.0
"""Where netem's tables end, in standard deviations."""
GROUP_SIZE: Final = 32
"""Number of destinations that share one hash where each link needs only ``PlainDraws``."""

_KEY: Final = Layout("<6q").pack
_EIGHT: Final = Layout("<8Q").unpack
_PAIR: Final = Layout("<4I").unpack_from
"""Two numbers of 64 bits, each as its lower and its upper half: halves need no long integers."""
_PAIR_B: Final = 16
_UNIT: Final = 1.0 / 2**53
_MIN_SHARE: Final = 2.0**-54
_MAX_SHARE: Final = 1.0 - 2.0**-53
_ROOT_2: Final = sqrt(2.0)
_normal: Final = NormalDist()


class Purpose(IntEnum):
    """What the numbers of one hash are for; a part of their key.

    When a frame needs a ninth number, add a purpose here and a type with the names of its numbers:
    it gives eight more, and all existing numbers stay as they are.
    """

    PLAIN = 0
    FRAME = 1
    COPY = 2


@final
@dataclass(init=False)
class PlainDraws:
    """The numbers in [0, 1) of a frame on a link that has only loss and uniform jitter."""

    loss: float
    delay: float

    def __init__(self, loss: float, delay: float) -> None:
        self.loss = loss
        self.delay = delay


@final
@dataclass
class FrameDraws:
    """The numbers in [0, 1) of a frame, or of its copy, on any link."""

    loss: float
    delay: float
    path_loss: float
    reorder: float
    state_step: float
    """Whether the Gilbert-Elliott state changes."""
    burst_loss: float
    duplicate: float
    corruption: float


def draw(seed: bytes, frame: Frame, destination: int, purpose: Purpose) -> FrameDraws:
    """Return the numbers of a frame on its link to a destination.

    The key is (seed, source, incarnation, destination, channel, count, purpose); seed: 32 bytes.
    """
    key = _KEY(frame.source, frame.incarnation, destination, frame.channel, frame.count, purpose)
    drawn = _EIGHT(blake2b(key, key=seed).digest())
    return FrameDraws(*[(number >> 11) * _UNIT for number in drawn])


def draw_group(seed: bytes, frame: Frame, group: int, last: int = GROUP_SIZE - 1) -> bytes:
    """Return the numbers of a frame for a group, up to the last destination; see ``plain_draws``.

    last: in any group the same as ``last % GROUP_SIZE``.
    """
    key = _KEY(frame.source, frame.incarnation, group, frame.channel, frame.count, Purpose.PLAIN)
    return shake_128(seed + key).digest((last % GROUP_SIZE + 1) * _PAIR_B)


def plain_draws(group_draw: bytes, destination: int) -> PlainDraws:
    """Return one destination's numbers from those of its group (destination // GROUP_SIZE)."""
    halves: tuple[int, int, int, int] = _PAIR(group_draw, destination % GROUP_SIZE * _PAIR_B)
    low, high, delay_low, delay_high = halves
    loss, delay = high << 21 | low >> 11, delay_high << 21 | delay_low >> 11
    return PlainDraws(loss * _UNIT, delay * _UNIT)


def uniform(share: float) -> float:
    """Return the quantile of the uniform shape, -1 to 1, at a share in [0, 1)."""
    return 2.0 * share - 1.0


def normal(share: float) -> float:
    """Return the quantile of the normal distribution, cut at the tables' ends."""
    return max(-MAX_QUANTILE, min(MAX_QUANTILE, _normal.inv_cdf(max(share, _MIN_SHARE))))


def pareto(share: float) -> float:
    """Return the quantile of netem's Pareto distribution: a = 3, shifted, cut above."""
    return min(MAX_QUANTILE, (pow(1.0 - share, -1.0 / 3.0) - 1.5) * (4.0 / 3.0))


def paretonormal(share: float) -> float:
    """Return the quantile of netem's mixture: a quarter normal, three quarters Pareto."""
    return 0.25 * normal(share) + 0.75 * pareto(share)


SHAPES: dict[str, Callable[[float], float]] = {
    "uniform": uniform,
    "normal": normal,
    "pareto": pareto,
    "paretonormal": paretonormal,
}


def normal_cdf(value: float) -> float:
    """Return the probability that a standard normal number is below a value."""
    return 0.5 * erfc(-value / _ROOT_2)


def correlated_share(
    share: float, last_score: float | None, correlation: float
) -> tuple[float, float]:
    """Return a share in [0, 1) correlated with the one before, and its score for the next call.

    An autoregression of normal scores keeps the distribution of any shape; netem's own method, a
    weighted mean of shares, narrows it. last_score: None for the first frame. correlation: of one
    score with the next, in [0, 1).
    """
    score = _normal.inv_cdf(max(share, _MIN_SHARE))
    if last_score is not None:
        score = correlation * last_score + sqrt(1.0 - correlation * correlation) * score
    return min(normal_cdf(score), _MAX_SHARE), score
