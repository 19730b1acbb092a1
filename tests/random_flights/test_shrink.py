"""Shrinking keeps what makes a scenario fail, and nothing else that can go."""

import tomllib
from typing import Any

from tests.random_flights.generate import objection, scenario
from tests.random_flights.shrink import flies, shrunk
from worldsim.scenario.file import as_toml
from worldsim.search.draws import Tables

TOO_NEAR = """
duration_s = 30.0
obstacle = [{ shape = "sphere", centre_m = [9, 0, 0], radius_m = 0.5 }]
event = [{ at_s = 3.0, kill = [2], for_s = 1.0 }, { at_s = 9.0, heal = true }]
[fleet]
agents = 3
start = { kind = "list", positions_m = [[0, 0, 0], [0.3, 0, 0], [2, 0, 0]] }
[control]
separation_m = 0.3
safety_m = 0.7
[vehicle]
radius_m = 0.05
"""


def test_only_what_makes_it_fail_is_left() -> None:
    def fails(tables: Tables) -> dict[str, Any] | None:
        killed = any("kill" in event for event in tables.get("event", []))
        return {"separation_at": (3.5, 0)} if killed and "radius_m" in tables["vehicle"] else None

    small = shrunk(tomllib.loads(TOO_NEAR), fails)
    assert small is not None
    assert small["duration_s"] == 3.7
    assert small["event"] == [{"at_s": 3.0, "kill": [2], "for_s": 1.0}]
    assert small["vehicle"] == {"radius_m": 0.05}
    assert small["fleet"]["start"]["positions_m"] == [[0, 0, 0], [0.3, 0, 0]]
    assert "obstacle" not in small
    assert small["control"] == {}


def test_what_does_not_fail_is_not_shrunk() -> None:
    tables = tomllib.loads(scenario(11, 0, steps=40).text)
    assert shrunk(tables, lambda each: flies(each, "I1")) is None


def test_what_check_refuses_is_no_smaller_scenario() -> None:
    refused = tomllib.loads(TOO_NEAR)
    assert objection(as_toml(refused))
    assert flies(refused, "exception") is None
