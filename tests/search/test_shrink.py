"""Shrinking keeps what makes a scenario fail, and nothing else that can go."""

import tomllib

import pytest

from tests.random_flights.generate import objection, scenario
from tests.random_flights.shrink import flies
from worldsim.scenario.file import as_toml
from worldsim.search.draws import Tables
from worldsim.search.shrink import Shrinker, Size, limit_s, quiet_from_s, shrunk, tidy
from worldsim.search.trials import fair_s

TOO_NEAR = """
duration_s = 30.0
obstacle = [{ shape = "sphere", centre_m = [9, 0, 0], radius_m = 0.5 }]
event = [
    { at_s = 3.0, kill = [2], for_s = 1.0 },
    { at_s = 5.0, partition = [[0, 1], [2]], for_s = 2.0 },
    { at_s = 9.0, heal = true },
]
[fleet]
agents = 4
start = { kind = "list", positions_m = [[5, 0, 0], [0, 0, 0], [0.3, 0, 0], [2, 0, 0]] }
[formation]
file = "pyramidal-wedge"
[control]
separation_m = 0.3
safety_m = 0.7
[vehicle]
radius_m = 0.05
[netem]
loss_percent = 10.37
"""


def fails(tables: Tables) -> float | None:
    """Fail wherever an agent is killed whose vehicles have a radius of their own."""
    killed = any("kill" in event for event in tables.get("event", []))
    return 3.5 if killed and "radius_m" in tables["vehicle"] else None


def test_a_fault_strikes_as_few_agents_as_do() -> None:
    def struck(tables: Tables) -> float | None:
        paused = [event["pause"] for event in tables.get("event", []) if "pause" in event]
        return 3.5 if paused else None

    event = [{"at_s": 1.0, "for_s": 1.0, "pause": ["random:3", "queue:Q1"]}]
    small = shrunk(tomllib.loads(TOO_NEAR) | {"event": event}, struck)
    assert small is not None
    assert small["event"][0]["pause"] in (["random:1"], ["queue:Q1"])


def test_only_what_makes_it_fail_is_left() -> None:
    small = shrunk(tomllib.loads(TOO_NEAR), fails)
    assert small is not None
    small = tidy(small)
    assert small["duration_s"] == 4.0
    assert small["event"] == [{"at_s": 1.0, "kill": [0], "for_s": 1.0}]
    assert small["vehicle"] == {"radius_m": 0.05}
    assert Size.of(small) == (1, 2, 4.0)
    assert len(small["fleet"]["start"]["positions_m"]) == 2
    assert small.keys() & {"obstacle", "control", "netem"} == set()


@pytest.mark.parametrize("forms", [True, False])
def test_a_flight_ends_after_the_violation_though_a_time_limit_is_longer(forms: bool) -> None:
    def breaks(tables: Tables) -> float | None:
        """Break an invariant, which is judged only in a team that forms something."""
        return 3.5 if tables["expect"]["converge"] >= forms and not objection(tables) else None

    def objection(tables: Tables) -> bool:
        return bool(tables["expect"].get("converge_within_s", 0.0) > tables["duration_s"])

    expect = {"converge_within_s": 20.0, "reform_within_s": 20.0, "converge": True}
    small = shrunk(tomllib.loads(TOO_NEAR) | {"expect": expect}, breaks)
    assert small is not None
    assert small["duration_s"] == 4.0
    assert small["expect"] == {"converge": forms}


def test_a_violation_that_shows_at_the_end_is_looked_for_earlier() -> None:
    def parts(tables: Tables) -> float | None:
        return tables["duration_s"] if tables["duration_s"] > 2.0 else None

    small = shrunk(tomllib.loads(TOO_NEAR), parts)
    assert small is not None
    assert 2.0 < small["duration_s"] <= 4.0


def test_a_time_limit_stays_fair_unless_it_is_certain_that_more_time_does_not_help() -> None:
    """The team comes to rest 9 s after the last event, as long as three agents are there."""

    def stuck(tables: Tables) -> float | None:
        allowed_s = limit_s(tables)
        assert allowed_s is not None
        if tables["fleet"]["agents"] < 3:
            return None
        certain_s = quiet_from_s(tables) + 9.0
        return certain_s if rests and certain_s <= tables["duration_s"] else tables["duration_s"]

    tables = tomllib.loads(TOO_NEAR) | {"duration_s": 100.0}
    tables["expect"] = {"converge_within_s": 80.0, "reform_within_s": 80.0, "converge": True}
    for rests in (True, False):
        small = shrunk(tables, stuck, timed=True)
        assert small is not None
        allowed_s = 9.0 if rests else fair_s(small)
        assert small["expect"] == {
            "converge_within_s": allowed_s,
            "reform_within_s": allowed_s,
            "converge": True,
        }
        assert Size.of(small) == (0, 3, allowed_s + 3.0)


def test_the_batch_size_changes_no_result() -> None:
    found = []
    for count in (1, 3):
        shrinker = Shrinker(tomllib.loads(TOO_NEAR), 3.5, timed=False)
        while batch := shrinker.batch(count):
            shrinker.take((each, fails(each)) for each in batch)
        found.append(shrinker.smallest)
    assert found[0] == found[1]


def test_a_budget_ends_it_with_what_fails() -> None:
    small = shrunk(tomllib.loads(TOO_NEAR), fails, budget=3)
    assert small is not None
    assert fails(small) == 3.5
    assert small["control"]


def test_agents_that_are_left_are_numbered_anew() -> None:
    tables = tomllib.loads(TOO_NEAR)
    parted = [each for each in tables["event"] if "partition" in each]

    def stays_parted(each: Tables) -> float | None:
        sides = [len(event["partition"]) for event in each.get("event", [])]
        return 6.0 if 2 in sides else None

    small = shrunk({**tables, "event": parted}, stays_parted)
    assert small is not None
    assert small["event"][0]["partition"] == [[0], [1]]


def test_what_does_not_fail_is_not_shrunk() -> None:
    tables = tomllib.loads(scenario(11, 0, steps=40).text)
    assert shrunk(tables, lambda each: flies(each, "I1")) is None


def test_what_check_refuses_is_no_smaller_scenario() -> None:
    refused = tomllib.loads(TOO_NEAR)
    assert objection(as_toml(refused))
    assert flies(refused, "exception") is None
