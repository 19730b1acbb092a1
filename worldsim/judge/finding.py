"""What the judge finds of a run: expectations that were met or not, and tallies of invariants."""

import msgspec


class Expectation(msgspec.Struct, frozen=True, kw_only=True):
    """A requirement on a run, and its measured value."""

    name: str
    """Its unit is in the name; a convergence is in seconds."""
    wanted: float | None
    """The limit; None: the value need only exist."""
    got: float | None
    """The measured value; None where there is none."""
    held: bool
    """Whether the requirement is met."""


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
