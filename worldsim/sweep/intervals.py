"""Confidence intervals of shares, and of differences between flights of the same seed.

Pure. All are two-sided at 95 %.
"""

from collections.abc import Sequence
from math import sqrt
from typing import NamedTuple

import numpy as np

CONFIDENCE = 0.95
Z = 1.959964
"""The 97.5 % quantile of the normal distribution."""
GRID = 20_001


class Interval(NamedTuple):
    """An estimate with its confidence interval."""

    value: float
    low: float
    high: float


def wilson(passed: int, count: int) -> Interval | None:
    """Return a share with its Wilson score interval, in [0, 1]; None without a flight.

    Wilson (1927), "Probable inference, the law of succession, and statistical inference".
    """
    if count == 0:
        return None
    share, spread = passed / count, Z * Z / count
    centre = (share + spread / 2.0) / (1.0 + spread)
    half = Z / (1.0 + spread) * sqrt(share * (1.0 - share) / count + spread / (4.0 * count))
    low = 0.0 if passed == 0 else max(0.0, centre - half)
    high = 1.0 if passed == count else min(1.0, centre + half)
    return Interval(share, low, high)


def paired_mean(differences: Sequence[float]) -> Interval | None:
    """Return the mean of paired differences with Student's interval; None for fewer than two."""
    count = len(differences)
    if count < 2:
        return None
    values = np.asarray(differences, dtype=np.float64)
    mean = float(values.mean())
    half = student_quantile(count - 1) * float(values.std(ddof=1)) / sqrt(count)
    return Interval(mean, mean - half, mean + half)


def student_quantile(freedom: int) -> float:
    """Return the 97.5 % quantile of Student's distribution of some degrees of freedom, from 1.

    With t = sqrt(f) tan(a), its density becomes cos(a)^(f-1), which is integrated numerically.
    """
    angle = np.linspace(0.0, np.pi / 2.0, GRID)
    density = np.cos(angle) ** (freedom - 1)
    area = np.concatenate(([0.0], np.cumsum((density[1:] + density[:-1]) / 2.0)))
    return float(sqrt(freedom) * np.tan(np.interp(CONFIDENCE, area / area[-1], angle)))


class Pairs(NamedTuple):
    """Flights of two sweeps by the same seed, counted by which of them pass."""

    both: int
    first: int  # the first one alone
    second: int  # the second one alone
    neither: int


def paired_share(pairs: Pairs) -> Interval | None:
    """Return the second share of passes less the first, with its interval; None without a pair.

    Newcombe (1998), "Improved confidence intervals for the difference between binomial proportions
    based on paired data", method 10: Wilson's intervals of both, with their correlation.
    """
    count = sum(pairs)
    one, other = wilson(pairs.both + pairs.first, count), wilson(pairs.both + pairs.second, count)
    if one is None or other is None:
        return None
    difference, phi = other.value - one.value, _correlation(pairs)

    def half(down: float, up: float) -> float:
        return sqrt(max(0.0, down * down - 2.0 * phi * down * up + up * up))

    return Interval(
        difference,
        difference - half(other.value - other.low, one.high - one.value),
        difference + half(other.high - other.value, one.value - one.low),
    )


def _correlation(pairs: Pairs) -> float:
    """Return Newcombe's phi, with his correction for continuity where it is positive."""
    both, first, second, neither = pairs
    margins = (both + first) * (second + neither) * (both + second) * (first + neither)
    if margins == 0:
        return 0.0
    crossed = float(both * neither - first * second)
    if crossed > 0:
        crossed = max(0.0, crossed - sum(pairs) / 2.0)
    return crossed / sqrt(margins)
