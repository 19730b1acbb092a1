"""What the judge finds of a run: expectations that were met or not, and tallies of invariants."""

from typing import Any, TypedDict

import msgspec


class ExpectationRow(TypedDict):
    """One expectation, in the unit of its name."""

    name: str
    wanted: Any
    got: Any
    margin: float | None  # on the good side of what is wanted
    held: bool | None  # None: the run was too short to tell


class Expectation(msgspec.Struct, frozen=True, kw_only=True):
    """A requirement on a run, and its measured value."""

    name: str
    """Its unit is in the name; a convergence is in seconds."""
    wanted: float | None
    """The limit; None: the value need only exist."""
    got: float | None
    """The measured value; None where there is none."""
    held: bool | None
    """Whether the requirement is met; None: the run was too short to tell."""
    at_least: bool = False
    """Whether the limit is a lower one."""

    @property
    def margin(self) -> float | None:
        """How far the value is on the good side of its limit, in its unit; None without both."""
        if self.wanted is None or self.got is None:
            return None
        return self.got - self.wanted if self.at_least else self.wanted - self.got

    @property
    def row(self) -> ExpectationRow:
        """The requirement as summary.json holds it."""
        return {
            "name": self.name,
            "wanted": self.wanted,
            "got": self.got,
            "margin": self.margin,
            "held": self.held,
        }


class InvariantTally(msgspec.Struct):
    """How often an invariant was evaluated and violated."""

    ticks: int = 0
    """Ticks at which it was evaluated."""
    violations: int = 0
    """Ticks at which it was violated."""

    def count(self, breaches: int) -> None:
        """Count a tick with this number of breaches."""
        self.ticks += 1
        self.violations += breaches > 0
