"""Flights that are repeated: whether their traces are alike."""

from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import pytest

from netem.wire.shutdown import StopRequest
from tests.small_scenario import SMALL
from worldsim.campaign.flight_site import Flown, Order
from worldsim.fuzz.flights import Hangar, Task
from worldsim.search.drafts import loaded


class Repeating:
    """A site whose flights of one scenario have given traces, one after another."""

    def __init__(self, traces: str) -> None:
        self._traces = iter(traces)

    def at_once(self) -> int:
        return 1

    def fly(self, orders: Iterable[Order], stop: StopRequest) -> Iterator[Flown]:
        for order in orders:
            trace = next(self._traces)
            summary: Any = {"expectations": [], "invariants": {}, "reason": None}
            yield Flown(order.key, "pass", None, {**summary, "trace_sha256": trace})


@pytest.mark.parametrize(
    ("traces", "margin", "different"),
    [("a", None, 1), ("aa", 1.0, 1), ("ab", -1.0, 2), ("aaab", -1.0, 2), ("abcd", -1.0, 4)],
)
def test_a_flight_is_repeated_and_its_traces_are_compared(
    traces: str, margin: float | None, different: int
) -> None:
    task = Task("a-again-b", loaded(SMALL, Path("small.toml")), flights=len(traces))
    (flown,) = Hangar(Repeating(traces), StopRequest()).fly([task])
    assert (flown.margins.get("repeat"), flown.different) == (margin, different)
