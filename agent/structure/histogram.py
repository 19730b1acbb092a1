"""How far the members of a queue are from its vertex: counts in bins, a byte each."""

from bisect import bisect_left
from collections.abc import Iterable
from typing import Final

BINS: Final = 16
EDGES_M: Final = tuple(0.75 * 1.31**k for k in range(BINS - 1))
"""Upper edge of each bin but the last [m]."""
EMPTY: Final = bytes(BINS)
OF_ONE: Final = tuple(bytes([k == filled for k in range(BINS)]) for filled in range(BINS))
"""The histogram of one member in each bin."""


def of_one(away_m: float) -> bytes:
    """Return the histogram of one member at a distance from the vertex [m]."""
    return OF_ONE[bisect_left(EDGES_M, away_m)]


def total(histograms: Iterable[bytes]) -> bytes:
    """Return the sum of histograms; a bin holds at most 255."""
    bins = [0] * BINS
    for each in histograms:
        if len(each) == BINS:
            bins = [count + each[k] for k, count in enumerate(bins)]
    return bytes([min(each, 255) for each in bins])


def share_nearer(histogram: bytes, away_m: float) -> float:
    """Return the share of the members that are nearer than a distance [m], from 0 to 1."""
    number = sum(histogram)
    if number == 0 or len(histogram) != BINS:
        return 0.0
    k = bisect_left(EDGES_M, away_m)
    low = EDGES_M[k - 1] if k > 0 else 0.0
    high = EDGES_M[k] if k < BINS - 1 else EDGES_M[-1] * 1.31
    within = min(1.0, (away_m - low) / (high - low))
    return (sum(histogram[:k]) + histogram[k] * within) / number
