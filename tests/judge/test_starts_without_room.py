"""An agent that was to start and found no room is a failed expectation, not a plain pass."""

from tests.small_scenario import SMALL
from worldsim.campaign.pool import finished
from worldsim.engine.virtual import fly
from worldsim.results.summary import Summary, summarise
from worldsim.scenario.file import parse

BESIDE = "{ kind = 'box', centre_m = [-1, 0, 0], size_m = [0.1, 0.1, 0.1], spacing_m = 0.6 }"
AWAY = "{ kind = 'box', centre_m = [-4, 0, 0], size_m = [0.1, 0.1, 0.1], spacing_m = 0.6 }"


def summary(start: str) -> Summary:
    event = f"[{{ at_s = 1, join = {{ count = 1, start = {start} }} }}]"
    scenario = parse(SMALL, overrides={"event": event, "duration_s": "9"})
    return summarise(scenario, finished(fly(scenario), scenario))


def test_a_join_without_room_fails_the_run_and_says_why() -> None:
    found = summary(BESIDE)
    assert found["outcome"] == "fail"
    assert "join at 1 s: there was no room, so no agent started" in (found["reason"] or "")
    (row,) = [row for row in found["expectations"] if row["name"] == "join at 1 s"]
    nothing = {"wanted": None, "got": None, "margin": None}
    assert row == {"name": "join at 1 s", **nothing, "held": False}


def test_a_join_with_room_adds_no_expectation() -> None:
    found = summary(AWAY)
    assert found["outcome"] == "pass"
    assert not [row for row in found["expectations"] if row["name"].startswith("join")]
