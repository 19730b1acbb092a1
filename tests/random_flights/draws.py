"""Draws from a seed made of words: the same words give the same values on every machine."""

from collections.abc import Sequence
from math import exp, log
from random import Random
from typing import Any, TypeVar

T = TypeVar("T")
Tables = dict[str, Any]
"""Plain tables, as a scenario file holds them."""


class Draw:
    """A sequence of draws. Numbers are short decimals, as a person would write them."""

    def __init__(self, *words: object) -> None:
        self._random = Random("/".join(map(str, words)))

    def chance(self, share: float) -> bool:
        return self._random.random() < share

    def among(self, options: Sequence[T]) -> T:
        return options[self._random.randrange(len(options))]

    def some(self, options: Sequence[T], count: int) -> list[T]:
        return self._random.sample(list(options), min(count, len(options)))

    def whole(self, low: int, high: int) -> int:
        """Return an integer from low to high, both included."""
        return self._random.randint(low, high)

    def number(self, low: float, high: float, digits: int = 2) -> float:
        return round(self._random.uniform(low, high), digits)

    def scale(self, low: float, high: float, digits: int = 2) -> float:
        """Return a number that is as often between 1 and 2 as between 2 and 4."""
        return max(low, round(exp(self._random.uniform(log(low), log(high))), digits))

    def point(self, half: float, height: float | None = None, digits: int = 2) -> list[float]:
        """Return a point within +-half along x and y, and +-height along z."""
        up = half if height is None else height
        return [self.number(-each, each, digits) for each in (half, half, up)]
