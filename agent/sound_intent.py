"""Whether an intent can be flown as it is: what most controllers return needs no conversion.

What a controller returns may hold anything. So types are looked at before values, and a value of
another class is never asked what it is.
"""

from math import inf
from typing import Any, Final

from agent.controller import NO_SIGNALS, NO_WORDS, Intent, Words
from agent.messages import MAX_ANGLE_RAD, MAX_SPEED_MPS, Place

MAX_INDEX: Final = 2**15
"""Queues and ranks are below it, and at least -1, as on the wire."""
SMALL: Final[float] = min(MAX_SPEED_MPS, MAX_ANGLE_RAD)
"""Numbers whose absolute values add up to no more than this are within every bound."""
_AXES: Final = 3
_PAIR: Final = 2


def is_sound(intent: object, trusts_words: bool) -> bool:
    """Return whether an intent is one of plain numbers within bounds that says nothing itself.

    trusts_words: whether its words need no check.
    """
    if type(intent) is not Intent:
        return False
    given: Any = intent  # compiled code would convert what it knows the type of
    words = given.words
    return (
        given.signals is NO_SIGNALS
        and _is_empty(given.messages)
        and _is_empty(given.blocked)
        and (words is NO_WORDS or (trusts_words and type(words) is Words))
        and claims_soundly(given)
        and moves_soundly(given)
    )


def moves_soundly(given: Any) -> bool:
    """Return whether an intent's numbers are plain floats, finite and small; most always are."""
    target = given.target
    # One sum shows that all are finite and small.
    size = (
        _size(given.wanted, _AXES)
        + _size(given.velocity, _AXES)
        + _size(given.heading_for, _AXES)
        + _size(given.tilt, _PAIR)
        + _size((given.yaw, given.force), _PAIR)
    )
    if target is not None:
        size += _size(target, _AXES)
    return size <= SMALL and bool(given.force >= 0.0)


def claims_soundly(given: Any) -> bool:
    """Return whether an intent's claim is of the right types and bounds."""
    cost_m, place = given.cost_m, given.place
    if not (type(cost_m) is float and 0.0 <= cost_m < inf and type(given.vertex) is bool):
        return False
    if place is None:
        return True
    if type(place) is not Place:
        return False
    numbers: tuple[Any, ...] = place
    queue, rank = numbers
    ints = type(queue) is int and type(rank) is int
    return ints and -1 <= queue < MAX_INDEX and -1 <= rank < MAX_INDEX


def _is_empty(given: Any) -> bool:
    return type(given) is tuple and len(given) == 0


def _size(given: Any, count: int) -> float:
    """Return the sum of the absolute values of a tuple of plain floats, inf for anything else."""
    if type(given) is not tuple or len(given) != count:
        return inf
    size = 0.0
    for each in given:
        if type(each) is not float:
            return inf
        number: float = each
        size += abs(number)
    return size
