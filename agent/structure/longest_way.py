"""A plan whose last member arrives sooner, though the sum of squared ways stays as it is.

Where a team turns about itself, many plans have the least sum: a line that turns by 90 degrees has
it in any order. Of these the plan with short longest ways is better, as long as the members pass
each other at a distance and stay in touch: all fly straight and equally fast.
"""

from collections.abc import Sequence
from itertools import combinations
from math import dist
from typing import Final

from agent.messages import Vector

MOST_MEMBERS, MOST_TRIES = 20, 250
"""A larger team, or more exchanges, take too long to look at: an agent plans within a few ticks."""
EQUAL_M2: Final = 1e-6
POWER: Final = 8
"""Ways count by this power, so that the longest ones count most."""
APART, IN_TOUCH = 0.5, 1.8
"""Members stay so many times the spacing apart, and linked by ways of at most so many."""
LOOKS: Final = 8
"""How often in the flight the links are looked at."""
SAVED: Final = 1e-3
"""Least saving of an exchange, as a share of the longest way's cost."""


def shortened(
    plan: Sequence[int], starts: Sequence[Vector], ends: Sequence[Vector], spacing_m: float
) -> list[int]:
    """Return a plan with shorter longest ways: for each start the index of its end.

    starts, ends [m; one frame].
    """
    found = [*plan]
    if len(found) > MOST_MEMBERS:
        return found
    search = _Search(starts, ends, spacing_m)
    while (pair := search.best_exchange(found)) is not None:
        _exchange(found, *pair)
    return found


class _Search:
    """The exchanges that one team may make."""

    def __init__(self, starts: Sequence[Vector], ends: Sequence[Vector], spacing_m: float) -> None:
        self._starts, self._ends = starts, ends
        self._ways = [[dist(start, end) for end in ends] for start in starts]
        self._least_m = APART * spacing_m
        self._link_m = IN_TOUCH * spacing_m
        self._tries = 0

    def best_exchange(self, plan: list[int]) -> tuple[int, int] | None:
        """Return the two whose exchange shortens the longest ways most; None for none."""
        for i, j in self._gainful(plan):
            if self._tries >= MOST_TRIES:
                return None
            self._tries += 1
            tried = [*plan]
            _exchange(tried, i, j)
            if self._stay_apart(tried, (i, j)) and self._stay_linked(tried):
                return i, j
        return None

    def _gainful(self, plan: list[int]) -> list[tuple[int, int]]:
        """Return the pairs whose exchange shortens the longest ways, those that do most first."""
        ways = self._ways
        least = SAVED * max(ways[k][end] for k, end in enumerate(plan)) ** POWER
        gains: list[tuple[float, int, int]] = []
        for i, j in combinations(range(len(plan)), 2):
            a, b, c, d = ways[i][plan[i]], ways[j][plan[j]], ways[i][plan[j]], ways[j][plan[i]]
            saved = a**POWER + b**POWER - c**POWER - d**POWER
            if saved > least and c * c + d * d - a * a - b * b < EQUAL_M2:
                gains.append((-round(saved / least, 3), i, j))
        return [(i, j) for _, i, j in sorted(gains)]

    def _stay_apart(self, plan: list[int], moved: tuple[int, int]) -> bool:
        return all(
            other == k or self._closest_m(plan, k, other) >= self._least_m
            for k in moved
            for other in range(len(plan))
        )

    def _closest_m(self, plan: list[int], i: int, j: int) -> float:
        """Return how near two come to each other [m]."""
        first, last = sorted((self._ways[i][plan[i]], self._ways[j][plan[j]]))
        apart = [
            _difference(self._at(plan, i, flown), self._at(plan, j, flown))
            for flown in (0.0, first, last)
        ]
        return min(_nearest_m(apart[0], apart[1]), _nearest_m(apart[1], apart[2]))

    def _stay_linked(self, plan: list[int]) -> bool:
        """Whether chains of short links connect all, all the time."""
        longest_m = max(self._ways[k][end] for k, end in enumerate(plan))
        return all(
            self._are_linked(
                [self._at(plan, k, look * longest_m / LOOKS) for k in range(len(plan))]
            )
            for look in range(1, LOOKS)
        )

    def _are_linked(self, points: list[Vector]) -> bool:
        reached, left = [points[0]], points[1:]
        while reached and left:
            here = reached.pop()
            reached += [each for each in left if dist(each, here) <= self._link_m]
            left = [each for each in left if dist(each, here) > self._link_m]
        return not left

    def _at(self, plan: list[int], k: int, flown_m: float) -> Vector:
        """Return where one is once each has flown a way, or has arrived."""
        (x, y, z), (u, v, w) = self._starts[k], self._ends[plan[k]]
        way_m = self._ways[k][plan[k]]
        share = min(1.0, flown_m / way_m) if way_m > 0.0 else 1.0
        return (x + share * (u - x), y + share * (v - y), z + share * (w - z))


def _exchange(plan: list[int], i: int, j: int) -> None:
    plan[i], plan[j] = plan[j], plan[i]


def _difference(a: Vector, b: Vector) -> Vector:
    return (a[0] - b[0], a[1] - b[1], a[2] - b[2])


def _nearest_m(a: Vector, b: Vector) -> float:
    """Return the distance of the origin from a line between two points [m]."""
    step = _difference(b, a)
    length2 = sum(each * each for each in step)
    ahead = -sum(p * s for p, s in zip(a, step, strict=True))
    share = min(1.0, max(0.0, ahead / length2)) if length2 > 0.0 else 0.0
    return dist((0.0, 0.0, 0.0), tuple(p + share * s for p, s in zip(a, step, strict=True)))
