"""Two runs or two sweeps side by side, in words.

Pure.
"""

from typing import Any

from worldsim.sweep.run_pair import RunPair
from worldsim.sweep.sweep_pair import CellPair, Difference, SweepPair
from worldsim.sweep.sweep_text import aligned

SHOWN = {
    "converge_s": ("converged in [s]", ".2f"),
    "min_separation_m": ("least separation [m]", ".3f"),
}
"""Figures of two sweeps that the table shows, in words, with their format."""
CLEAR = "*"
"""Marks a difference whose interval does not hold zero."""

MAX_TEXT = 40
"""A longer value, such as a commit, is cut [characters]."""


def run_pair_text(pair: RunPair) -> str:
    """Return two runs side by side: figures, differing keys of the scenarios, traces."""
    rows: list[tuple[str, ...]] = [("", *pair["runs"])]
    rows += [(name, *map(_text, values)) for name, values in pair["figures"].items()]
    lines = [*aligned(rows), ""]
    differing = [(key, *map(_text, both)) for key, both in pair["scenario_differs"].items()]
    if differing:
        lines += ["the scenarios differ in:", *(f"  {line}" for line in aligned(differing))]
    else:
        lines.append("the scenarios are equal")
    return "\n".join([*lines, pair["trace_text"]])


def sweep_pair_text(pair: SweepPair) -> str:
    """Return two sweeps side by side: a row for each cell, with the paired differences."""
    first, second = pair["sweeps"]
    keys = list(pair["cells"][0]["settings"])
    heads = ["pass", *(words for words, _ in SHOWN.values())]
    rows = [(*keys, "pairs", *heads, "same trace")]
    rows += [_cell(cell) for cell in pair["cells"]]
    flights = sum(cell["pairs"] for cell in pair["cells"])
    same = sum(cell["same_traces"] for cell in pair["cells"])
    unpaired = [
        f"{count} flights of {name} have no partner"
        for name, count in zip(pair["sweeps"], pair["unpaired"], strict=True)
        if count
    ]
    return "\n".join(
        [
            f"first: {first}   second: {second}",
            "first -> second: second less first (95 % interval, paired by seed);"
            f" {CLEAR} clear of 0",
            "",
            *aligned(rows),
            "",
            f"{flights} pairs of flights, {same} of them with the same trace",
            *unpaired,
        ]
    )


def _cell(cell: CellPair) -> tuple[str, ...]:
    return (
        *cell["settings"].values(),
        str(cell["pairs"]),
        _difference(cell["pass_share"], ".2f"),
        *(_difference(cell["figures"][name], form) for name, (_, form) in SHOWN.items()),
        str(cell["same_traces"]),
    )


def _difference(found: Difference | None, form: str) -> str:
    if found is None:
        return "-"
    sides = f"{found['first']:{form}} -> {found['second']:{form}}"
    low, high = found["low"], found["high"]
    if low is None or high is None:
        return f"{sides}: {found['difference']:+{form}}"
    if low == high == 0.0:
        return f"{sides}: none"
    mark = f" {CLEAR}" if low > 0.0 or high < 0.0 else ""
    return f"{sides}: {found['difference']:+{form}} ({low:+{form}} to {high:+{form}}){mark}"


def _text(value: Any) -> str:
    if value is None:
        return "-"
    return f"{value:.4g}" if isinstance(value, float) else str(value)[:MAX_TEXT]
