"""Distances and angles, from rows of truth. Definitions are those of the README."""

import numpy as np
from numpy.typing import NDArray

from worldsim.judge.tick import Singles

Floats = NDArray[np.float64]


def swept_separation(before: Singles, after: Singles) -> Floats:
    """Return each vehicle's least distance to any other while both move from tick to tick [m].

    before, after: (N, 3) [m]; motion between ticks is taken as straight. NaN rows, and a vehicle
    that is alone, give NaN.
    """
    start = _between_rows(before)
    change = _between_rows(after) - start
    along = np.sum(change * change, axis=2)
    closing = -np.sum(start * change, axis=2)
    when = np.clip(closing / np.where(along > 0.0, along, 1.0), 0.0, 1.0)
    nearest = start + when[:, :, None] * change
    distance = np.sqrt(np.sum(nearest * nearest, axis=2))
    np.fill_diagonal(distance, np.inf)
    least = np.where(np.isnan(distance), np.inf, distance).min(axis=1)
    return np.where(np.isfinite(least), least, np.nan)


def _between_rows(position: Singles) -> Floats:
    wide = position.astype(np.float64)
    return wide[:, None, :] - wide[None, :, :]
