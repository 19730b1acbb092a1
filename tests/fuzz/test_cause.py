"""`qswarm cause` finds the tick after which nothing that comes can avoid a failure."""

from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Any

import pytest

from netem.wire.shutdown import StopRequest
from tests.small_scenario import SMALL
from worldsim.campaign.flight_site import Flown, Order
from worldsim.fuzz.cause import Cause, find_cause
from worldsim.fuzz.findings import keep
from worldsim.fuzz.flights import Hangar
from worldsim.fuzz.probe import Redraw
from worldsim.results.run_folder import write_json
from worldsim.scenario.tables import SLOTS_PER_TICK, Scenario

TICK_HZ = 20.0
EVENTS = """
event = [
    { at_s = 1.0, kill = [1], for_s = 1.0 },
    { at_s = 2.5, partition = [[0], [1]], for_s = 0.5 },
    { at_s = 4.0, pause = [1], for_s = 0.5 },
]
"""
Fails = Callable[[Scenario, float], bool]
"""Whether a scenario fails whose draws are other ones from a time on [s]."""


class Law:
    """A site whose flights fail by a law, without being flown."""

    def __init__(self, fails: Fails) -> None:
        self._fails = fails

    def at_once(self) -> int:
        return 4

    def fly(self, orders: Iterable[Order], stop: StopRequest) -> Iterator[Flown]:
        for order in orders:
            probe: Any = order.probe
            from_s = probe._slot / SLOTS_PER_TICK / TICK_HZ if isinstance(probe, Redraw) else 99.0
            bad = self._fails(order.scenario, from_s)
            summary: Any = {
                "expectations": [],
                "invariants": {"I3": {"ticks": 1, "violations": int(bad)}},
                "reason": None,
                "trace_sha256": "",
            }
            yield Flown(order.key, "fail" if bad else "pass", None, summary)


def cause_of(folder: Path, fails: Fails, events: str = EVENTS) -> Cause:
    """Return the cause of a finding with some events, which fails by a law."""
    (folder / "scenario.toml").write_text(events + SMALL, encoding="utf-8")
    size = {"faults": 3, "agents": 2, "duration_s": 5.0}
    finding: Any = {
        "name": "I3-0",
        "property": "I3",
        "reason": None,
        "original_size": size,
        "size": size,
        "shrink_flights": 0,
        "trouble_s": 4.5,
        "last_event": None,
    }
    write_json(folder / "finding.json", finding)
    keep(folder, finding)
    found = find_cause(folder, Hangar(Law(fails), StopRequest()), 20, lambda _: None)
    assert found is not None
    assert (found.text in (folder / "finding.md").read_text()) == found.replays
    return found


def times(scenario: Scenario) -> list[float]:
    return [each.at_s for each in scenario.event]


@pytest.mark.parametrize("at_s", [1.0, 2.5])
def test_a_failure_that_an_event_brings_is_certain_from_the_event_on(
    tmp_path: Path, at_s: float
) -> None:
    found = cause_of(tmp_path, lambda scenario, _: at_s in times(scenario))
    assert (found.certain_s, found.from_the_start) == (at_s, 1.0)
    assert found.needed is not None
    assert found.needed["at_s"] == at_s
    assert "No draw matters" in found.text


@pytest.mark.parametrize(("number", "end_s"), [(0, 2.0), (1, 3.0)])
def test_a_failure_that_the_end_of_a_fault_brings_is_certain_from_its_end_on(
    tmp_path: Path, number: int, end_s: float
) -> None:
    """Until then, the fault may last: a flight in which it does not end does not fail."""
    at_s = [1.0, 2.5][number]

    def fails(scenario: Scenario, _: float) -> bool:
        return any(each.at_s == at_s and each.for_s for each in scenario.event)

    found = cause_of(tmp_path, fails)
    assert found.certain_s == end_s
    assert found.text.endswith(f", and its end at {end_s:g} s.")


def test_a_failure_that_a_draw_brings_is_certain_from_the_tick_of_the_draw_on(
    tmp_path: Path,
) -> None:
    found = cause_of(tmp_path, lambda _, from_s: from_s > 3.2)
    assert (found.certain_s, found.from_the_start, found.needed) == (3.25, 0.0, None)
    assert "With other draws from the start, 0 % fail" in found.text


def test_a_failure_that_needs_both_is_certain_from_the_later_on(tmp_path: Path) -> None:
    found = cause_of(tmp_path, lambda scenario, s: s > 1.5 and 2.5 in times(scenario))
    assert found.certain_s == 2.5


def test_a_failure_that_needs_nothing_is_certain_from_the_start(tmp_path: Path) -> None:
    found = cause_of(tmp_path, lambda *_: True)
    assert (found.certain_s, found.needed) == (0.0, None)
    assert "without any event" in found.text


def test_what_does_not_fail_has_no_cause(tmp_path: Path) -> None:
    assert cause_of(tmp_path, lambda *_: False) == Cause(replays=False)


def test_a_fault_that_comes_again_comes_once_until_then_and_is_undone_each_time(
    tmp_path: Path,
) -> None:
    """Else each kill would last: a flight in which nobody is left would fail for sure."""
    seen: list[tuple[float | None, float | None]] = []

    def fails(scenario: Scenario, from_s: float) -> bool:
        seen.extend((each.for_s, each.every_s) for each in scenario.event)
        return any(each.every_s for each in scenario.event)

    found = cause_of(
        tmp_path, fails, "event = [{ at_s = 1.0, kill = [1], for_s = 0.5, every_s = 1.5 }]"
    )
    assert found.certain_s == 2.5
    assert set(seen) == {(0.5, 1.5), (0.5, None), (None, None)}
