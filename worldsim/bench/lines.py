"""The printed lines of the benchmark."""

from worldsim.bench.comparison import MARKED_PERCENT, Change
from worldsim.bench.measures import Row


def line(row: Row, change: Change | None = None, marked: float = MARKED_PERCENT) -> str:
    """Return a row as it is printed. change: against the saved figure, where there is one.

    What got worse by more than ``marked`` percent is marked.
    """
    if row.measured is None:
        head = f"{row.name:44} {'-':>10} invalid: {row.invalid}"
        if change is None or not change.worse_by(marked):
            return head
        return f"{head}; saved {change.note}  WORSE"
    digits = 2 if row.unit in ("x", "x real time", "%") else 1
    head = f"{row.name:44} {row.measured:10.{digits}f} {row.unit}"
    compared = f"{head:73} {_compared(change, marked)}" if change is not None else head
    if row.goal is None:
        return compared.rstrip()
    verdict = "" if row.reached else "  not reached"
    width = 73 if change is None else 105
    return f"{compared:{width}} goal {'>=' if row.more else '<='} {row.goal:g}{verdict}"


def summary_line(changes: dict[str, Change], file: str, marked: float = MARKED_PERCENT) -> str:
    """Return how many figures got worse, and which."""
    compared = [each for each in changes.values() if each.ratio is not None]
    worse = [name for name, each in changes.items() if each.worse_by(marked)]
    named = f": {'; '.join(worse)}" if worse else ""
    return (
        f"against {file}: {len(compared)} compared,"
        f" {len(worse)} worse by more than {marked:g} %{named}"
    )


def _compared(change: Change, marked: float) -> str:
    if change.ratio is None:
        return change.note
    worse = "  WORSE" if change.worse_by(marked) else ""
    return f"{change.ratio:6.2f} x {change.note}{worse}"
