"""Chance on a link: numbers that belong to one frame, and the shapes that delays have.

A shape is the quantile function of tc-netem's table of the same name, in standard deviations, as
iproute2 computes the table: jitter_ms times its value is what is added to delay_ms. The uniform
shape is netem's own default, from -1 to 1.
"""

from collections.abc import Callable
from hashlib import blake2b, shake_128
from math import erfc, pow, sqrt
from statistics import NormalDist
from struct import Struct as Layout

Numbers = tuple[float, ...]
WIDEST = 32767.0 / 8192.0
"""Where netem's tables end, in standard deviations."""
SHARING = 32
"""So many destinations share one draw where each needs no more than two numbers."""

_KEY = Layout("<6q").pack
_NUMBERS = Layout("<8Q").unpack
_PAIR = Layout("<2Q").unpack_from
_PAIR_B = 16
_UNIT = 1.0 / 2**53
_LEAST = 2.0**-54
_MOST = 1.0 - 2.0**-53
_ROOT_2 = sqrt(2.0)
_normal = NormalDist()


def draw(
    seed: bytes,
    source: int,
    incarnation: int,
    destination: int,
    channel: int,
    count: int,
    purpose: int,
) -> Numbers:
    """Return eight numbers in [0, 1) that belong to one frame on one link and to nothing else.

    purpose: over 0, what several draws for one frame and link differ in.

    They are keyed, not drawn in sequence: order, process and shard do not matter.
    """
    key = _KEY(source, incarnation, destination, channel, count, purpose)
    drawn = _NUMBERS(blake2b(key, key=seed).digest())
    return tuple([(number >> 11) * _UNIT for number in drawn])


def draw_shared(
    seed: bytes, source: int, incarnation: int, group: int, channel: int, count: int
) -> bytes:
    """Return what one frame draws for a group of ``SHARING`` destinations; see ``pair``."""
    key = _KEY(source, incarnation, group, channel, count, 0)
    return shake_128(seed + key).digest(SHARING * _PAIR_B)


def pair(shared: bytes, destination: int) -> tuple[float, float]:
    """Return one destination's two numbers in [0, 1) of what its group drew."""
    first, second = _PAIR(shared, destination % SHARING * _PAIR_B)
    return (first >> 11) * _UNIT, (second >> 11) * _UNIT


def uniform(share: float) -> float:
    """Return the quantile of the uniform shape, -1 to 1, at a share in [0, 1)."""
    return 2.0 * share - 1.0


def normal(share: float) -> float:
    """Return the quantile of the normal distribution, cut at the tables' ends."""
    return max(-WIDEST, min(WIDEST, _normal.inv_cdf(max(share, _LEAST))))


def pareto(share: float) -> float:
    """Return the quantile of netem's Pareto distribution: a = 3, shifted, cut above."""
    return min(WIDEST, (pow(1.0 - share, -1.0 / 3.0) - 1.5) * (4.0 / 3.0))


def paretonormal(share: float) -> float:
    """Return the quantile of netem's mixture, a quarter normal and three quarters Pareto."""
    return 0.25 * normal(share) + 0.75 * pareto(share)


SHAPES: dict[str, Callable[[float], float]] = {
    "uniform": uniform,
    "normal": normal,
    "pareto": pareto,
    "paretonormal": paretonormal,
}


def below(value: float) -> float:
    """Return the share of a standard normal distribution below a value."""
    return 0.5 * erfc(-value / _ROOT_2)


def correlated(share: float, last: float | None, correlation: float) -> tuple[float, float]:
    """Return a share that remembers the one before, and what to remember of it.

    An autoregression of normal scores (correlation from one to the next), so that any shape stays
    what it is; netem's own, a weighted mean of shares, narrows it. ``last`` is None at first.
    """
    score = _normal.inv_cdf(max(share, _LEAST))
    if last is not None:
        score = correlation * last + sqrt(1.0 - correlation * correlation) * score
    return min(below(score), _MOST), score
