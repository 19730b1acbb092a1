"""How far a measurement may be from what is configured, and still be chance: 99.9 % intervals."""

from collections.abc import Callable
from math import asin, pi, sqrt

import numpy as np
from numpy.typing import NDArray

from netem.link import LinkModel, mean_loss

Z = 3.2905
"""Of 1 000 normal numbers one is farther off, in standard deviations."""
KOLMOGOROV = 1.9495
"""The same for the largest distance between two distributions, times sqrt(n)."""
GRID = 400_000
Floats = NDArray[np.float64]


def share_bound(share: float, count: int) -> float:
    """Return how far a share of independent draws may be off."""
    return Z * sqrt(share * (1.0 - share) / max(1, count))


def loss_bound(link: LinkModel, count: int) -> float:
    """Return how far a link's mean loss may be off, its bursts counted in.

    Var = (p (1-p) + 2 sum of covariances) / n. Over k frames the covariance of a two-state chain is
    (b-g)^2 pi_b pi_g rho^k, rho = 1-p-r; with b = 1 and g = 0 all of it is
    p (1-p) (1+rho) / (1-rho).
    """
    loss, model = mean_loss(link), link.gemodel
    variance = loss * (1.0 - loss)
    if model is not None and model.p_percent + model.r_percent > 0.0:
        turns = (model.p_percent + model.r_percent) / 100.0
        bad = model.p_percent / 100.0 / turns
        kept = 1.0 - link.loss_percent / 100.0
        apart = kept * (model.loss_bad_percent - model.loss_good_percent) / 100.0
        variance += 2.0 * apart * apart * bad * (1.0 - bad) * (1.0 - turns) / turns
    return Z * sqrt(max(0.0, variance) / count)


def delays_s(link: LinkModel, shape: Callable[[float], float]) -> Floats:
    """Return the quantiles of a link's delays [s], GRID of them at equal steps, in order."""
    overtaking = link.reorder_percent / 100.0
    shares = ((np.arange(GRID) + 0.5) / GRID).tolist()
    late = np.array([max(0.0, link.delay_ms + link.jitter_ms * shape(each)) for each in shares])
    if overtaking == 0.0:
        return late / 1000.0
    at = (np.arange(GRID) + 0.5) / GRID
    index = np.clip((at - overtaking) / max(1.0 - overtaking, 1e-12), 0.0, 1.0) * (GRID - 1)
    return np.where(at < overtaking, 0.0, late[index.astype(np.int64)]) / 1000.0


def farthest(samples: Floats, quantiles: Floats) -> float:
    """Return Kolmogorov and Smirnov's D: how far two distributions are apart; steps are allowed."""
    places = np.unique(samples)
    ordered, far = np.sort(samples), 0.0
    for side in ("left", "right"):
        ours = np.searchsorted(ordered, places, side) / len(samples)
        theirs = np.searchsorted(quantiles, places, side) / len(quantiles)
        far = max(far, float(np.max(np.abs(ours - theirs))))
    return far


def effective(link: LinkModel, count: int) -> float:
    """Return for how many independent delays so many of a link count: they remember each other."""
    rho = link.delay_correlation_percent / 100.0
    return count * (1.0 - rho) / (1.0 + rho)


def rank_correlation(samples: Floats) -> float:
    """Return how the ranks of neighbours in a series correlate (Spearman, lag 1)."""
    ranks = np.argsort(np.argsort(samples, kind="stable"), kind="stable").astype(np.float64)
    return float(np.corrcoef(ranks[:-1], ranks[1:])[0, 1])


def rank_correlation_of(correlation: float) -> float:
    """Return the rank correlation that a correlation of normal scores makes."""
    return 6.0 / pi * asin(correlation / 2.0)
