"""A row of the benchmark: what is measured, the figure found, and whether it reaches its goal."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from fnmatch import fnmatchcase
from typing import NamedTuple


class InvalidFigureError(Exception):
    """A measurement that proves nothing; the text says why."""


class Measure(NamedTuple):
    """What a row measures, and how."""

    name: str
    unit: str  # of goal, grain and figure
    goal: float | None  # None: the figure is there to be known
    more: bool  # whether a greater figure is better; then the goal is the least one
    measure: Callable[[], float]  # raises InvalidFigureError
    grain: float = 0.0  # differences up to this one mean nothing


@dataclass(frozen=True, slots=True)
class Row:
    """One figure, the best of some repeats: a busy host can only make it worse."""

    name: str
    unit: str
    """Of goal and measured."""
    goal: float | None
    """None: the figure is there to be known."""
    measured: float | None
    """None: it is invalid."""
    more: bool
    """Whether a greater value is better; then the goal is the least value."""
    invalid: str | None = None
    """Why there is no figure."""

    @property
    def reached(self) -> bool:
        """Whether the goal is reached, if there is one."""
        if self.measured is None:
            return False
        if self.goal is None:
            return True
        return self.measured >= self.goal if self.more else self.measured <= self.goal


def measured_row(measure: Measure, repeats: int) -> Row:
    """Measure a row ``repeats`` times; return it with its best figure."""
    best, invalid = None, None
    try:
        found = [measure.measure() for _ in range(repeats)]
        best = max(found) if measure.more else min(found)
    except InvalidFigureError as error:
        invalid = str(error)
    return Row(measure.name, measure.unit, measure.goal, best, measure.more, invalid)


def chosen(measures: Iterable[Measure], patterns: Iterable[str]) -> list[Measure]:
    """Return the measures whose names match a pattern, in their order; all without patterns.

    Raises LookupError with the first pattern that no name matches.
    """
    measures, patterns = list(measures), list(patterns)
    for pattern in patterns:
        if not any(_matches(measure, pattern) for measure in measures):
            raise LookupError(pattern)
    return [
        measure
        for measure in measures
        if not patterns or any(_matches(measure, pattern) for pattern in patterns)
    ]


def _matches(measure: Measure, pattern: str) -> bool:
    return fnmatchcase(measure.name.lower(), pattern.lower())
