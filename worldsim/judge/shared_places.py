"""Places that several agents claim, and for how long: I4 of the invariants."""

from collections.abc import Sequence
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

Claims = list[tuple[int, int]]
"""The place (queue, rank) that each agent claims; row i = agent i."""
Hears = NDArray[np.bool_]
"""Whether the agent of a row hears that of a column."""
WHOLE = 1.0 + 1e-9
"""More than all of the time allowed, but for rounding."""


Pair = tuple[int, int]
"""The rows of two agents, the lower one first."""


class SharedPlaces:
    """Which pairs of agents claim one place though they need know of each other, and how long.

    It is a pair that is given time to agree: an agent whose rivals change has a new pair to agree
    with each time. local: whether an agent knows the claims of those that it hears, as under
    leaders and trees. Under the assignment it knows those of its whole component.
    """

    def __init__(self, local: bool) -> None:
        self.local = local
        self._sharing: dict[Pair, tuple[int, int]] = {}
        """The place of each pair that shares one."""
        self._spent: dict[Pair, tuple[tuple[int, int], float]] = {}
        """For each of these pairs: the place, and the share of the time allowed."""
        self._seen_s = 0.0

    def find(self, claims: Claims, members: Sequence[list[int]], hears: Hears | None) -> None:
        """Find the pairs that share a place. members: the rows of each component."""
        self._sharing = {}
        for rows in members:
            holders: dict[tuple[int, int], list[int]] = {}
            for row in rows:
                holders.setdefault(claims[row], []).append(row)
            for claim, sharing in holders.items():
                if claim[0] >= 0:
                    for pair in combinations(sharing, 2):
                        if not self.local or _hear_each_other(pair, hears):
                            self._sharing[pair] = claim

    def count_lasting(self, time_s: float, longest_s: float) -> int:
        """Return how many agents have shared a place with another for longer than allowed.

        longest_s: how long two may under the present radio [s]; infinite: for any time. Where the
        radio changes meanwhile, the shares of the time allowed under each add up.
        """
        since_s, self._seen_s = time_s - self._seen_s, time_s
        spent = {}
        for pair, claim in self._sharing.items():
            last, before = self._spent.get(pair, (None, 0.0))
            spent[pair] = (claim, before + since_s / longest_s if claim == last else 0.0)
        self._spent = spent
        return len({row for pair, (_, each) in spent.items() if each > WHOLE for row in pair})

    def forget(self) -> None:
        """Start anew: no two have shared a place until now."""
        self._spent = {}


def _hear_each_other(pair: Pair, hears: Hears | None) -> bool:
    if hears is None:
        return False
    return bool(hears[pair] and hears[pair[::-1]])
