"""What a sweep flies: varied keys, the grid of their values, and the seeds of each cell.

Pure: texts in, a plan out.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import product
from typing import NamedTuple

from worldsim.scenario.toml import value_of

MAX_FLIGHTS = 1_000_000
OWN_OPTIONS = {"seed": "--seeds"}
"""Keys that an option of their own varies."""
_OPENING, _CLOSING, _QUOTES = "[{", "]}", "\"'"
IDLE = ("name", "schema")
"""Keys that change no flight."""


Settings = tuple[tuple[str, str], ...]
"""Some keys with their values, as texts."""


class PlanError(ValueError):
    """What is wrong with a plan, in one line."""


class Axis(NamedTuple):
    """One varied key of the scenario."""

    key: str  # dotted
    values: tuple[str, ...]  # as in TOML; a bare word is text

    @property
    def numbers(self) -> tuple[float, ...] | None:
        """The values as numbers; None where one of them is none."""
        values = [value_of(text) for text in self.values]
        if any(isinstance(each, bool) or not isinstance(each, int | float) for each in values):
            return None
        return tuple(float(each) for each in values)


class FlightKey(NamedTuple):
    """One flight of a sweep."""

    cell: int  # index into Plan.cells
    seed: int


@dataclass(frozen=True, slots=True)
class Plan:
    """The grid of a sweep. Raises PlanError for a key that is varied twice, or too many flights."""

    axes: tuple[Axis, ...]
    seeds: range

    def __post_init__(self) -> None:
        keys = [axis.key for axis in self.axes]
        twice = next((key for key in keys if keys.count(key) > 1), None)
        if twice is not None:
            raise PlanError(f"{twice}: is varied twice; write all its values in one --vary")
        if len(self) > MAX_FLIGHTS:
            raise PlanError(f"{len(self)} flights; at most {MAX_FLIGHTS}")

    @property
    def cells(self) -> list[tuple[str, ...]]:
        """The value of each axis in each cell; the last axis changes fastest."""
        return list(product(*(axis.values for axis in self.axes)))

    def settings(self, cell: int) -> dict[str, str]:
        """Return the value of each varied key in a cell."""
        settings = {}
        for axis in reversed(self.axes):
            cell, value = divmod(cell, len(axis.values))
            settings[axis.key] = axis.values[value]
        return dict(reversed(settings.items()))

    def flights(self) -> Iterator[FlightKey]:
        """Yield all flights, seed by seed: a sweep that is cut off has seen every cell alike."""
        cells = len(self.cells)
        return (FlightKey(cell, seed) for seed in self.seeds for cell in range(cells))

    def __len__(self) -> int:
        cells = 1
        for axis in self.axes:
            cells *= len(axis.values)
        return cells * len(self.seeds)


def axis_of(text: str) -> Axis:
    """Return the axis of a text such as ``netem.loss_percent=0,30,50``. Raises PlanError.

    Commas within brackets and quotes belong to a value.
    """
    key, equals, listed = text.partition("=")
    key = key.strip()
    if not equals or not key:
        raise PlanError(f"{text!r}; write it as netem.loss_percent=0,30,50")
    if key in OWN_OPTIONS:
        raise PlanError(f"{key}: is varied by {OWN_OPTIONS[key]}")
    if key in IDLE:
        raise PlanError(f"{key}: changes no flight")
    values = tuple(part.strip() for part in _split(listed))
    if not all(values):
        raise PlanError(f"{key}: has no value, or an empty one; write it as {key}=A,B,C")
    twice = _repeated(values)
    if twice is not None:
        raise PlanError(f"{key}: has the value {twice} twice")
    return Axis(key, values)


def _repeated(values: Sequence[str]) -> str | None:
    """Return the first value that means the same as an earlier one, as 50 and 50.0 do."""
    seen: list[tuple[bool, object]] = []
    for text in values:
        meaning = value_of(text)
        marked = (isinstance(meaning, bool), meaning)  # 1 is not true
        if marked in seen:
            return text
        seen.append(marked)
    return None


def _split(text: str) -> list[str]:
    """Return the parts of a text between its commas outside brackets and quotes."""
    parts, depth, quote = [""], 0, ""
    for letter in text:
        if quote:
            quote = "" if letter == quote else quote
        elif letter in _QUOTES:
            quote = letter
        depth += (letter in _OPENING) - (letter in _CLOSING) if not quote else 0
        if letter == "," and depth == 0 and not quote:
            parts.append("")
        else:
            parts[-1] += letter
    return parts
