"""Distances and angles, from rows of truth. Definitions are those of the README."""

import numpy as np
from numpy.typing import NDArray

from worldsim.judge.tick import Packets, Singles

Floats = NDArray[np.float64]


def swept_separation(before: Singles, after: Singles) -> Floats:
    """Return each vehicle's least distance to any other while both move from tick to tick [m].

    before, after: (N, 3) [m]; motion between ticks is taken as straight. NaN rows, and a vehicle
    that is alone, give NaN.
    """
    start = _between_rows(before)
    change = [after - before for before, after in zip(start, _between_rows(after), strict=True)]
    along = _dot(change, change)
    when = -_dot(start, change) / np.where(along > 0.0, along, 1.0)
    when = np.minimum(np.maximum(when, 0.0), 1.0)
    nearest = [a + when * b for a, b in zip(start, change, strict=True)]
    distance = np.sqrt(_dot(nearest, nearest))
    np.fill_diagonal(distance, np.inf)
    least = np.where(np.isnan(distance), np.inf, distance).min(axis=1)
    return np.where(np.isfinite(least), least, np.nan)


def conserved(packets: Packets) -> bool:
    """Whether every packet addressed was delivered, or dropped, or is in flight (I8)."""
    whereabouts = ("delivered", "dropped_", "in_flight")
    known = sum(count for name, count in packets.items() if name.startswith(whereabouts))
    return known == packets["addressed"]


def _between_rows(position: Singles) -> list[Floats]:
    """Return x, y, z of row j as seen from row i, each (N, N) [m]."""
    return [axis[None, :] - axis[:, None] for axis in position.T.astype(np.float64)]


def _dot(a: list[Floats], b: list[Floats]) -> Floats:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
