"""A planted bug makes a difference when its trigger comes, and the difference is noted."""

import json
from collections.abc import Iterator
from pathlib import Path

import pytest

from agent.comms.whereabouts import Whereabouts
from netem.wire.shutdown import StopRequest
from tests.agent.comms.builders import ORIGIN, heard_beacon
from tests.planted_bugs import BESIDE, PLANTS, DifferenceProbe, Window
from tests.planted_figures import last_tick
from tests.small_scenario import SMALL
from worldsim.campaign.flight_site import LocalSite, Order
from worldsim.fuzz.flights import Hangar, Task
from worldsim.scenario.tables import Scenario
from worldsim.search.drafts import loaded

FAR = SMALL.replace("[-1.3, 0, 0]", "[-4.0, 0, 0]")
"""The second agent flies for seconds."""


def flying(event: str) -> Scenario:
    return loaded(f"event = [{event}]\n{FAR}", BESIDE)


@pytest.fixture
def site(tmp_path: Path) -> Iterator[LocalSite]:
    yield LocalSite(1, tmp_path / "work")


@pytest.mark.pure
@pytest.mark.parametrize(
    ("name", "event", "earliest_s", "latest_s"),
    [
        ("held_command", "{ at_s = 2.0, kill = [1] }", 2.0, 2.3),
        ("lasting_partition", "{ at_s = 2.0, partition = [[0], [1]], for_s = 1.0 }", 3.0, 3.05),
        ("forgotten_tombstone", "{ at_s = 2.0, kill = [1] }", 2.1, 4.0),
        ("version_alone", "{ at_s = 2.0, kill = [1], for_s = 1.0 }", 3.0, 4.5),
    ],
)
def test_a_difference_is_noted_when_the_trigger_comes(
    name: str,
    event: str,
    earliest_s: float,
    latest_s: float,
    site: LocalSite,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    PLANTS[name](monkeypatch)
    order = Order(name, flying(event), DifferenceProbe(), (DifferenceProbe.FILE,))
    (shown,) = site.fly([order], StopRequest())
    at_s = json.loads(shown.files[DifferenceProbe.FILE])
    assert at_s is not None
    assert earliest_s <= at_s <= latest_s


@pytest.mark.pure
def test_an_unkeyed_draw_shows_in_a_second_flight(
    site: LocalSite, monkeypatch: pytest.MonkeyPatch
) -> None:
    lossy = f"{FAR}\n[netem]\nloss_percent = 30.0\n"
    task = Task("it", loaded(lossy, BESIDE), flights=2)
    (kept,) = Hangar(site, StopRequest()).fly([task])
    PLANTS["unkeyed_draw"](monkeypatch)
    (other,) = Hangar(site, StopRequest()).fly([task])
    assert (kept.margins["repeat"], other.margins["repeat"]) == (1.0, -1.0)


@pytest.mark.pure
def test_a_mended_bug_flies_as_the_right_code(
    site: LocalSite, monkeypatch: pytest.MonkeyPatch
) -> None:
    scenario, hangar = flying("{ at_s = 2.0, kill = [1] }"), Hangar(site, StopRequest())

    def trace(first: int, end: int | None) -> str | None:
        (flown,) = hangar.fly([Task("it", scenario, Window(first, end))])
        return flown.trace

    right = trace(0, None)
    PLANTS["held_command"](monkeypatch)
    assert trace(0, None) != right
    assert trace(0, 1) == right
    assert trace(10**6, None) == right


@pytest.mark.pure
def test_a_stale_frame_counts_as_said_now(monkeypatch: pytest.MonkeyPatch) -> None:
    PLANTS["stale_frame"](monkeypatch)
    known = Whereabouts(0, 2)
    known.hear(heard_beacon(1, 1, 2.0))
    (report,) = known.reports(ORIGIN, 9.0)
    assert report.age_s == 0.0


@pytest.mark.parametrize("last", [0, 1, 11, 12, 13, 87, 99, 100])
def test_the_last_tick_in_which_something_holds_is_found(last: int) -> None:
    asked: list[int] = []

    def holds(tick: int) -> bool:
        asked.append(tick)
        return tick <= last

    assert last_tick(101, holds) == last
    assert len(asked) < 16
