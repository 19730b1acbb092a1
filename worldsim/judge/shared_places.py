"""Places that several agents claim, and for how long: I4 of the invariants."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

Claims = list[tuple[int, int]]
"""The place (queue, rank) that each agent claims; row i = agent i."""
Hears = NDArray[np.bool_]
"""Whether the agent of a row hears that of a column."""
WHOLE = 1.0 + 1e-9
"""More than all of the time allowed, but for rounding."""


class SharedPlaces:
    """For each agent, whether another agent that need know it claims its place, and how long.

    local: whether an agent knows the claims of those that it hears, as under leaders and trees.
    Under the assignment it knows those of its whole component.
    """

    def __init__(self, local: bool) -> None:
        self.local = local
        self._claims: Claims = []
        self._shared: list[bool] = []
        self._spent: dict[int, tuple[tuple[int, int], float]] = {}
        """For each agent that shares its place: the place, and the share of the time allowed."""
        self._seen_s = 0.0

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
        """Return how many agents have shared their present place for longer than allowed.

        longest_s: how long they may under the present radio [s]; infinite: for any time. Where the
        radio changes meanwhile, the shares of the time allowed under each add up.
        """
        since_s, self._seen_s = time_s - self._seen_s, time_s
        if not any(self._shared):
            self._spent = {}
            return 0
        spent = {}
        for row, shared in enumerate(self._shared):
            if shared:
                claim, before = self._spent.get(row, (None, 0.0))
                now = self._claims[row]
                spent[row] = (now, before + since_s / longest_s if claim == now else 0.0)
        self._spent = spent
        return sum(each > WHOLE for _, each in spent.values())

    def forget(self) -> None:
        """Start anew: none has shared its place until now."""
        self._spent = {}


def _hears_rival(row: int, sharing: Sequence[int], hears: Hears | None) -> bool:
    """Whether an agent hears another of those that share its place, and is heard by it."""
    if hears is None:
        return False
    return any(other != row and bool(hears[row, other] and hears[other, row]) for other in sharing)
