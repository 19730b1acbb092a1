"""Shrinking of a finding: what may count as a smaller scenario of it."""

import json
import tomllib
from collections.abc import Iterable, Iterator
from math import inf
from pathlib import Path
from typing import Any

import pytest

from netem.wire.shutdown import StopRequest
from tests.small_scenario import SMALL
from worldsim.campaign.flight_site import Flown, Order
from worldsim.fuzz import flights
from worldsim.fuzz.findings import begin
from worldsim.fuzz.shrinking import rest_s, shrink
from worldsim.search.margins import margins_of

DRAWN = """
event = [{ at_s = 1.0, pause = [1], for_s = 1.0 }]
expect = { converge = true, converge_within_s = %g }
"""


class RestingWithEvents:
    """A site whose teams never form; they stand still only where an event comes."""

    def at_once(self) -> int:
        return 4

    def fly(self, orders: Iterable[Order], stop: StopRequest) -> Iterator[Flown]:
        for order in orders:
            scenario = order.scenario
            row = {"name": "converge line", "held": False, "margin": None, "wanted": None}
            summary: Any = {
                "expectations": [row],
                "invariants": {},
                "reason": "",
                "trace_sha256": "",
            }
            assert margins_of(summary) == {"converge": -1.0}
            measured = {
                "first_s": {},
                "rest_since_s": 2.0 if scenario.event else scenario.duration_s,
                "t_s": [0.0],
                "slot_error_m": [3.0],
            }
            files = {
                flights.MARGINS_FILE: json.dumps(measured).encode(),
                flights.EVENTS_FILE: b"",
            }
            yield Flown(order.key, "fail", None, summary, files=files)


def test_shrinking_that_goes_on_counts_a_time_limit_as_it_was_drawn(tmp_path: Path) -> None:
    """It was interrupted where the limit was short already, for a team at rest.

    A team that still moves by then has not failed.
    """
    row = {"seed": 1, "how": "random", "violated": ["converge"], "reason": "", "duration_s": 64.0}
    text = SMALL.replace("duration_s = 5.0", "duration_s = 64.0" + DRAWN % 60.0)
    begin(tmp_path, text, row, flights.Flown("it", {"converge": -1.0}, "", ""))
    short = SMALL.replace("duration_s = 5.0", "duration_s = 16.0" + DRAWN % 12.0)
    (tmp_path / "scenario.toml").write_text(short, encoding="utf-8")
    found = shrink(tmp_path, flights.Hangar(RestingWithEvents(), StopRequest()), lambda _: None)
    assert found is not None
    assert found["shrink_flights"] > 0
    left = tomllib.loads((tmp_path / "scenario.toml").read_text(encoding="utf-8"))
    assert left["event"], "a smaller scenario counted in which the team still moves"


def test_what_cannot_be_replayed_stays_as_it_was_drawn_and_its_page_says_so(
    tmp_path: Path,
) -> None:
    row = {"seed": 1, "how": "random", "violated": ["I3"], "reason": "", "duration_s": 5.0}
    begin(tmp_path, SMALL, row, flights.Flown("it", {"I3": -1.0}, "", ""))
    assert "not made smaller" not in (tmp_path / "finding.md").read_text()
    shrink(tmp_path, flights.Hangar(RestingWithEvents(), StopRequest()), lambda _: None)
    assert "not made smaller" in (tmp_path / "finding.md").read_text()
    assert (tmp_path / "scenario.toml").read_text() == SMALL


@pytest.mark.parametrize(
    ("tables", "seconds"),
    [
        ({}, 10.0),
        ({"netem": {"loss_percent": 90.0}}, 60.0),
        ({"netem": {"multihop": {"loss_percent": 80.0}}, "comms": {"multihop_hz": 1.0}}, 60.0),
        ({"netem": {"loss_percent": 80.0}, "comms": {"multihop_hz": 0.0, "local_hz": 5.0}}, 12.0),
        ({"netem": {"loss_percent": 100.0}}, inf),
    ],
)
def test_a_team_may_stand_still_for_as_long_as_it_waits_for_news(
    tables: dict[str, Any], seconds: float
) -> None:
    assert rest_s(tables) == pytest.approx(seconds)
