"""The bottleneck assignment: the least time in which a team can be in its places.

Every agent flies straight to a place of its own; the assignment is the one whose last arrival is
earliest. No scheme is faster.
"""

from bisect import bisect_left

import numpy as np

from worldsim.scenario.tables import CONVERGED_M
from worldsim.truth.vehicle import Floats


def arrival_bound_s(positions: Floats, slots: Floats, speeds: Floats) -> float:
    """Return when the last agent is in place, in the best assignment [s].

    positions: (N, 3), slots: (M, 3) with M >= N [m; one frame]; speeds: (N,) [m/s]. An agent is in
    place within CONVERGED_M of its slot.
    """
    away = np.linalg.norm(positions[:, None] - slots[None, :], axis=2)
    return bottleneck(np.maximum(0.0, away - CONVERGED_M) / speeds[:, None])


def bottleneck(costs: Floats) -> float:
    """Return the least largest cost of a pair when each row gets a column of its own.

    costs: (N, M) with M >= N; 0 without rows.
    """
    if not len(costs):
        return 0.0
    levels = np.unique(costs).tolist()
    first = bisect_left(levels, True, key=lambda level: _covers(costs <= level))
    return float(levels[first])


def _covers(allowed: Floats) -> bool:
    """Return whether each row can have an allowed column of its own: augmenting paths."""
    columns = [np.flatnonzero(row).tolist() for row in allowed]
    owner: dict[int, int] = {}

    def place(row: int, tried: set[int]) -> bool:
        for column in columns[row]:
            if column not in tried:
                tried.add(column)
                if column not in owner or place(owner[column], tried):
                    owner[column] = row
                    return True
        return False

    return all(place(row, set()) for row in range(len(columns)))
