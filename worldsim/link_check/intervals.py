"""99.9 % intervals: how far a correct measurement may differ from the configured value."""

from collections.abc import Callable
from math import asin, pi, sqrt

import numpy as np
from numpy.typing import NDArray

from netem.link import mean_loss
from netem.link_model import LinkModel

Z = 3.2905
"""Half width of the 99.9 % interval of a normal number, in standard deviations."""
KOLMOGOROV = 1.9495
"""99.9 % bound of the Kolmogorov-Smirnov distance, times sqrt(n)."""
GRID = 400_000
Floats = NDArray[np.float64]


def share_bound(share: float, count: int) -> float:
    """Return the half width for the mean of ``count`` independent draws of a share in [0, 1]."""
    return Z * sqrt(share * (1.0 - share) / max(1, count))


def loss_bound(link: LinkModel, count: int) -> float:
    """Return the half width for a link's mean loss, correlated where it has bursts.

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


def delay_quantiles_s(link: LinkModel, shape: Callable[[float], float]) -> Floats:
    """Return GRID quantiles of a link's delay distribution, at equal steps, ascending [s]."""
    overtaking = link.reorder_percent / 100.0
    shares = ((np.arange(GRID) + 0.5) / GRID).tolist()
    late = np.array([max(0.0, link.delay_ms + link.jitter_ms * shape(each)) for each in shares])
    if overtaking == 0.0:
        return late / 1000.0
    at = (np.arange(GRID) + 0.5) / GRID
    index = np.clip((at - overtaking) / max(1.0 - overtaking, 1e-12), 0.0, 1.0) * (GRID - 1)
    return np.where(at < overtaking, 0.0, late[index.astype(np.int64)]) / 1000.0


def kolmogorov_smirnov(samples: Floats, quantiles: Floats) -> float:
    """Return the Kolmogorov-Smirnov distance D of two distributions, which may have steps."""
    places = np.unique(samples)
    ordered, distance = np.sort(samples), 0.0
    for side in ("left", "right"):
        measured = np.searchsorted(ordered, places, side) / len(samples)
        configured = np.searchsorted(quantiles, places, side) / len(quantiles)
        distance = max(distance, float(np.max(np.abs(measured - configured))))
    return distance


def effective_count(link: LinkModel, count: int) -> float:
    """Return the number of independent delays that ``count`` correlated ones are worth."""
    rho = link.delay_correlation_percent / 100.0
    return count * (1.0 - rho) / (1.0 + rho)


def rank_correlation(samples: Floats) -> float:
    """Return Spearman's rank correlation of a series with itself, shifted by one."""
    ranks = np.argsort(np.argsort(samples, kind="stable"), kind="stable").astype(np.float64)
    return float(np.corrcoef(ranks[:-1], ranks[1:])[0, 1])


def rank_correlation_of(correlation: float) -> float:
    """Return the rank correlation of normal scores with a given correlation."""
    return 6.0 / pi * asin(correlation / 2.0)
