"""Places that several agents claim, and for how long: I4 of the invariants."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

Claims = list[tuple[int, int]]
"""The place (queue, rank) that each agent claims; row i = agent i."""
Hears = NDArray[np.bool_]
"""Whether the agent of a row hears that of a column."""


class SharedPlaces:
    """For each agent, whether another agent that need know it claims its place, and since when.

    local: whether an agent knows the claims of those that it hears, as under leaders and trees.
    Under the assignment it knows those of its whole component.
    """

    def __init__(self, local: bool) -> None:
        self.local = local
        self._claims: Claims = []
        self._shared: list[bool] = []
        self._since: dict[int, tuple[tuple[int, int], float]] = {}
        """For each agent that shares its place: the place, and since when [s; simulated time]."""

    def find(self, claims: Claims, members: Sequence[list[int]], hears: Hears | None) -> None:
        """Find the agents that share their place. members: the rows of each component."""
        self._claims, self._shared = claims, [False] * len(claims)
        for rows in members:
            holders: dict[tuple[int, int], list[int]] = {}
            for row in rows:
                holders.setdefault(claims[row], []).append(row)
            for claim, sharing in holders.items():
                if claim[0] >= 0 and len(sharing) > 1:
                    for row in sharing:
                        self._shared[row] = not self.local or _hears_rival(row, sharing, hears)

    def count_lasting(self, time_s: float, longest_s: float) -> int:
        """Return how many agents have shared their present place for longer than that [s]."""
        if not any(self._shared):
            self._since = {}
            return 0
        since = {}
        for row, shared in enumerate(self._shared):
            if shared:
                claim, from_s = self._since.get(row, (None, time_s))
                now = self._claims[row]
                since[row] = (now, from_s if claim == now else time_s)
        self._since = since
        return sum(time_s - from_s > longest_s for _, from_s in since.values())

    def forget(self) -> None:
        """Start anew: none has shared its place until now."""
        self._since = {}


def _hears_rival(row: int, sharing: Sequence[int], hears: Hears | None) -> bool:
    """Whether an agent hears another of those that share its place, and is heard by it."""
    if hears is None:
        return False
    return any(other != row and bool(hears[row, other] and hears[other, row]) for other in sharing)
