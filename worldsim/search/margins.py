"""How far a flight was from violating each property: 1 far, 0 at the limit, negative beyond it.

A margin is a share of the property's own limit, so that properties can be compared: of the least
distance (separation, clearance), of the time allowed (converge, reform), or 1 and -1 where an
invariant merely holds or not.
"""

from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Any, Final

from worldsim.judge.metrics import ROUNDING_M
from worldsim.results.outcome import INVARIANT_WORDS

SAFETY: Final = ("separation", "clearance", "error")
CONSERVATION: Final = ("I5", "I8", "repeat")
LIVENESS: Final = ("converge", "reform", "I2", "I3", "I4", "I6", "I7")
PROPERTIES: Final = (*SAFETY, *CONSERVATION, *LIVENESS)
WORDS: Final = {
    "separation": "two vehicles came nearer to each other than separation_m",
    "clearance": "a vehicle came nearer to an obstacle than clearance_m",
    "error": "the flight ended by an error",
    "repeat": "the same seed flew another way the second time",
    "converge": "the team did not form its formation in the time allowed",
    "reform": "the team did not form its formation again in the time allowed after the last fault",
    **{name: INVARIANT_WORDS[name] for name in ("I2", "I3", "I4", "I5", "I6", "I7", "I8")},
}
"""What the violation of each property means."""
DISTANCES: Final = {
    "min_separation_m": "separation",
    "min_obstacle_distance_m": "clearance",
}
Margins = dict[str, float]
"""By property; one that could not be measured is absent."""


def margins_of(summary: Mapping[str, Any]) -> Margins:
    """Return the margins of a flight from its summary (see worldsim.results.summary)."""
    found: Margins = {}
    for row in summary["expectations"]:
        name = _property(row["name"])
        margin = None if name is None else _of_expectation(row)
        if name is not None and margin is not None:
            found[name] = min(margin, found.get(name, 1.0))
    for name, tally in summary["invariants"].items():
        if name in INVARIANT_WORDS and name != "I1" and tally["ticks"]:
            found[name] = -1.0 if tally["violations"] else 1.0
    return found


def of_error() -> Margins:
    """Return the margins of a flight that an error ended."""
    return {"error": -1.0}


def of_repetition(margins: Margins, same: bool) -> Margins:
    """Return the margins of a flight that was repeated. same: whether the traces are equal."""
    return {**margins, "repeat": 1.0 if same else -1.0}


def violated(margins: Margins) -> list[str]:
    """Return the properties that were violated, the gravest first."""
    return [name for name in PROPERTIES if margins.get(name, 1.0) < 0.0]


def score(margins: Margins) -> float:
    """Return how far a flight was from its first violation: what a search lowers.

    A tenth of the mean tells flights apart that have the same least margin.
    """
    values = [max(-1.0, min(1.0, each)) for each in margins.values()]
    return round(min(values) + 0.1 * sum(values) / len(values), 6) if values else 1.0


def approached(margins: Sequence[float | None]) -> float:
    """Return the least margin that is less than the one before: what a flight came near to.

    A distance that the vehicles start with says nothing about what they do. margins: of each tick,
    None where nothing was measured.
    """
    known = [each for each in margins if each is not None]
    fell = [now for before, now in pairwise(known) if now < before]
    return min(fell, default=1.0)


def _property(expectation: str) -> str | None:
    """Return the property that an expectation belongs to; None: none of the search's."""
    if expectation.startswith("converge "):
        return "converge"
    return {"reform_within_s": "reform", **DISTANCES}.get(expectation)


def _of_expectation(row: Mapping[str, Any]) -> float | None:
    """Return the margin of an expectation, as a share of its limit; None where it is open."""
    if row["held"] is None:
        return None
    if row["margin"] is None or not row["wanted"]:
        return 1.0 if row["held"] else -1.0
    share = row["margin"] / row["wanted"]
    if row["held"]:
        return float(max(share, 0.0))
    return float(min(share, -ROUNDING_M))
