"""Figures beside saved ones: the ratio, what got worse, and what makes the two incomparable."""

from collections.abc import Iterator
from math import inf
from typing import NamedTuple

from worldsim.bench.measures import Measure, Row
from worldsim.bench.saved_figures import Saved, SavedRow

MARKED_PERCENT = 10.0
"""What got worse by more is marked."""
SHOWN_SHA = 12


class Change(NamedTuple):
    """A figure against the saved one."""

    ratio: float | None  # now to then; None: not comparable
    worse_percent: float  # by how much it got worse; 0: it did not
    note: str  # the saved figure, or why there is no ratio

    def worse_by(self, percent: float) -> bool:
        """Return whether the figure got worse by more than this."""
        return self.worse_percent > percent + 1e-9


def incomparable(figure: Measure | Row, before: SavedRow | None) -> str | None:
    """Return why a figure cannot be compared with what is saved; None where it can."""
    if before is None:
        return "not in the file"
    if (before.unit, before.more) != (figure.unit, figure.more):
        return f"saved in {before.unit}: not comparable"
    return "saved as invalid" if before.measured is None else None


def change(row: Row, before: SavedRow | None, grain: float = 0.0) -> Change:
    """Compare a row. grain: differences up to this one mean nothing [the row's unit].

    Where a greater figure is better, worse counts on the inverse: half the speed is 100 % worse.
    """
    reason = incomparable(row, before)
    if before is None or before.measured is None or reason is not None:
        return Change(None, 0.0, reason or "")
    note = f"{before.measured:.4g}"
    if row.measured is None:
        return Change(None, inf, note)
    ratio = _ratio(row.measured, before.measured)
    worse = _ratio(before.measured, row.measured) if row.more else ratio
    if abs(row.measured - before.measured) <= grain:
        worse = 1.0
    return Change(ratio, max(0.0, 100.0 * (worse - 1.0)), note)


def differences(now: Saved, then: Saved) -> Iterator[str]:
    """Yield what other than the commit may explain different figures, in words."""
    if now.host != then.host:
        yield f"another machine: {_machine(then)}; now {_machine(now)}"
    if now.python != then.python:
        yield f"another Python: {then.python}; now {now.python}"
    changed = [name for name in now.packages if now.packages[name] != then.packages.get(name)]
    if changed:
        yield f"other versions of {', '.join(changed)}"
    if now.code != then.code:
        yield f"another form of the code: {then.code}; now {now.code}"
    if then.commit_dirty:
        yield f"the saved figures are of a modified commit, {_commit(then)}"
    if now.commit_dirty:
        yield f"this code is a modified commit, {_commit(now)}"
    if now.repeats != then.repeats:
        yield f"the best of {then.repeats}; now of {now.repeats}"
    if now.seconds != then.seconds:
        yield f"fleets of processes flew {_time(then)}; now {_time(now)}"


def _ratio(over: float, under: float) -> float:
    if under == 0.0:
        return 1.0 if over == 0.0 else inf
    return over / under


def _machine(figures: Saved) -> str:
    host = figures.host
    return f"{host.os} {host.machine}, {host.cpus} x {host.cpu or 'an unknown processor'}"


def _commit(figures: Saved) -> str:
    return figures.commit[:SHOWN_SHA] if figures.commit is not None else "unknown"


def _time(figures: Saved) -> str:
    return "their own time" if figures.seconds is None else f"{figures.seconds:g} s"
