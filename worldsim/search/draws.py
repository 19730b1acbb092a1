"""Draws from a seed made of words: the same words give the same values on every machine."""

from collections.abc import Mapping, Sequence
from math import exp, log
from random import Random
from typing import Any, TypeVar

T = TypeVar("T")
Tables = dict[str, Any]
"""Plain tables, as a scenario file holds them."""
Genes = dict[str, float]
"""Numbers in [0, 1) by name: all that a scenario is drawn from."""


class Draw:
    """A sequence of draws. Numbers are short decimals, as a person would write them."""

    def __init__(self, *words: object) -> None:
        self._random = Random("/".join(map(str, words)))

    def chance(self, share: float) -> bool:
        """Return True so often."""
        return self._random.random() < share

    def among(self, options: Sequence[T]) -> T:
        """Return one of some options."""
        return options[self._random.randrange(len(options))]

    def some(self, options: Sequence[T], count: int) -> list[T]:
        """Return up to ``count`` different ones of some options, in random order."""
        return self._random.sample(list(options), min(count, len(options)))

    def whole(self, low: int, high: int) -> int:
        """Return an integer from low to high, both included."""
        return self._random.randint(low, high)

    def number(self, low: float, high: float, digits: int = 2) -> float:
        """Return a number from low to high, rounded to so many digits."""
        return round(self._random.uniform(low, high), digits)

    def scale(self, low: float, high: float, digits: int = 2) -> float:
        """Return a number that is as often between 1 and 2 as between 2 and 4."""
        return max(low, round(exp(self._random.uniform(log(low), log(high))), digits))

    def point(self, half: float, height: float | None = None, digits: int = 2) -> list[float]:
        """Return a point within +-half along x and y, and +-height along z."""
        up = half if height is None else height
        return [self.number(-each, each, digits) for each in (half, half, up)]


class GeneDraw(Draw):
    """Draws of which each takes a named number, so that one can be changed and the others stay.

    words: the seed of the numbers that ``given`` does not hold. What a ``part`` draws has names of
    its own: an event that draws one number more does not shift those of the next event.
    """

    def __init__(self, *words: object, given: Mapping[str, float] | None = None) -> None:
        self.used: Genes = {}
        """Every number that was drawn, by name, in the order of the draws."""
        self._words, self._given = words, given if given is not None else {}
        self._random = _Named(self, "")

    def part(self, *name: object) -> "GeneDraw":
        """Return the draws of a named part."""
        part = GeneDraw(*self._words, given=self._given)
        part.used = self.used
        part._random = _Named(part, "".join(f"{each}/" for each in name))
        return part

    def gene(self, name: str) -> float:
        """Return a number in [0, 1) by its name."""
        if name not in self.used:
            given = self._given.get(name)
            word = "/".join(map(str, (*self._words, name)))
            self.used[name] = Random(word).random() if given is None else given
        return self.used[name]


class _Named(Random):
    """A source whose k-th number is the gene of that number; other draws derive from these."""

    def __init__(self, genes: GeneDraw, prefix: str) -> None:
        super().__init__(0)
        self._genes, self._prefix, self._count = genes, prefix, 0

    def random(self) -> float:
        self._count += 1
        return self._genes.gene(f"{self._prefix}{self._count}")
