"""Properties of the user's own that a run must show: [[expect.property]]."""

from collections.abc import Iterator
from typing import Annotated, Literal

from msgspec import Meta

from agent.config import Positive, Table
from agent.messages import SignalName

Figure = Literal[
    "separation_m",
    "slot_error_m",
    "obstacle_distance_m",
    "speed_mps",
    "turn_deg",
    "running",
    "parted",
]
"""What the judge measures of each agent; but of the team: running, the number of agents whose
process runs, and parted, 1 while a fault parts the team, else 0."""
Over = Literal["each", "mean", "least", "most", "spread"]
Must = Literal["always", "eventually", "settle", "sometimes"]
Counted = Literal["all", "undisturbed", "after"]
Bound = Annotated[float, Meta(ge=-1e12, le=1e12)]
Title = Annotated[str, Meta(min_length=1, max_length=120, pattern=r"^[^\x00-\x1f]*$")]
Seconds = Annotated[float, Meta(ge=0, le=86_400)]


class Condition(Table, frozen=True, omit_defaults=True):
    """A bound on a signal, which controllers state, or on a figure, which the judge measures.

    over: whether each agent that has a value must keep the bound, or one number of the team: the
    mean, the least, the most, or the spread (the most less the least).
    """

    signal: SignalName | None = None
    figure: Figure | None = None
    over: Over = "each"
    at_least: Bound | None = None
    at_most: Bound | None = None

    @property
    def text(self) -> str:
        """The condition in words, such as "spread of meet_x <= 0.05"."""
        what = self.signal or self.figure or ""
        subject = what if self.over == "each" else f"{self.over} of {what}"
        relations = (("<=", self.at_most), (">=", self.at_least))
        bounds = [f"{relation} {bound:g}" for relation, bound in relations if bound is not None]
        return f"{subject} {' and '.join(bounds)}"


class Property(Condition, frozen=True, omit_defaults=True):
    """A property that a run must show, over its ticks.

    must: "always": at every tick that counts; "eventually": at one of them, by within_s; "settle":
    from some time on, by within_s, until the end, and for 2 s at least; "sometimes": in some run of
    a campaign, which never fails a run. within_s: from from_s; left out: by the end. from_s, to_s:
    the times that count. counted: "undisturbed": not while a fault parts the team, nor for
    reform_within_s, or 10 s, from the beginning and end of each fault; "after": after the last one.
    where: only ticks count at which these conditions hold too.
    """

    name: Title | None = None
    must: Must = "always"
    within_s: Positive | None = None
    from_s: Seconds = 0.0
    to_s: Seconds | None = None
    counted: Counted = "all"
    where: Annotated[tuple[Condition, ...], Meta(max_length=8)] = ()

    @property
    def title(self) -> str:
        """Its name, or the condition in words."""
        return self.name or self.text

    def conditions(self) -> Iterator[tuple[str, Condition]]:
        """Yield its own condition and those of ``where``, each with its key."""
        yield "", self
        for index, each in enumerate(self.where):
            yield f".where[{index}]", each
