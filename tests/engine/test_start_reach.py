"""``check`` warns of vertices and agents that are out of range at the start."""

import pytest

from worldsim.engine.start_reach import start_warnings
from worldsim.scenario.file import parse

PAIR = """
duration_s = 60.0
[fleet]
agents = 5
start = {{ kind = "list", positions_m = {positions} }}
[formation]
name = "pair"
vertices = {{ V1 = [0, 0, 0], V2 = [{far}, 0, 0] }}
queue = [
    {{ name = "A", vertices = ["V1"], shape = {{ kind = "ray", direction = [0, 1, 0] }} }},
    {{ name = "B", vertices = ["V2"], shape = {{ kind = "ray", direction = [0, 1, 0] }} }},
]
[netem]
range_m = 3.0
"""
CHAIN = [[0, 0, 0], [2.5, 0, 0], [5, 0, 0], [7.5, 0, 0], [10, 0, 0]]
APART = [[0, 0, 0], [2, 0, 0], [4, 0, 0], [20, 0, 0], [22, 0, 0]]


def told(positions: list[list[float]], far: float = 10.0, **overrides: str) -> list[str]:
    keys = {key.replace("__", "."): value for key, value in overrides.items()}
    scenario = parse(PAIR.format(positions=positions, far=far), overrides=keys)
    found = start_warnings(scenario)
    assert all(each.key == "fleet.start" for each in found)
    return [each.detail for each in found]


def test_a_chain_that_hears_itself_and_reaches_each_vertex_is_no_problem() -> None:
    assert told(CHAIN) == []


def test_a_team_that_hears_itself_finds_a_vertex_that_no_radio_reaches() -> None:
    assert told(CHAIN, far=16.0) == []


def test_a_vertex_that_no_radio_reaches_is_named_with_the_nearest_agent() -> None:
    (detail,) = told(APART, far=28.0)
    assert "vertex 'V2'" in detail
    assert "the nearest agent, 4, starts 6 m from it, and is heard up to 3 m" in detail


def test_groups_that_do_not_hear_each_other_are_counted() -> None:
    (detail,) = told(APART, far=22.0)
    assert detail.startswith("2 groups of agents do not hear each other (3, 2 agents)")
    (detail,) = told(APART, far=12.0)
    assert "vertex 'V2'" in detail
    assert "2 groups of agents do not hear each other (3, 2 agents)" in detail


@pytest.mark.parametrize(
    "link",
    ["{ from = 1, to = 2, loss_percent = 100 }", "{ from = 1, to = 2, range_m = 1 }"],
    ids=["loss", "range"],
)
def test_a_link_that_works_one_way_does_not_join_two_groups(link: str) -> None:
    (detail,) = told(CHAIN, netem__link=f"[{link}]")
    assert detail.startswith("2 groups of agents do not hear each other (3, 2 agents)")


def test_a_single_radio_that_reaches_farther_reaches_the_vertex() -> None:
    link = "[{ from = 4, to = 3, range_m = 7 }]"
    (detail,) = told(APART, far=28.0, netem__link=link)
    assert "vertex" not in detail


def test_the_frames_start_counts() -> None:
    first, second = told(APART, far=22.0, frame__waypoints_m="[[0, 9, 0]]")
    assert "vertex 'V1'" in first
    assert "vertex 'V2'" in second
    (detail,) = told(APART, far=22.0, frame__waypoints_m="[[0, 2, 0]]")
    assert "vertex" not in detail


def test_agents_that_join_later_do_not_count() -> None:
    start = "{ kind = 'list', positions_m = [[90, 0, 0]] }"
    event = f"[{{ at_s = 1, join = {{ count = 1, start = {start} }} }}]"
    assert told(CHAIN, event=event) == []


def test_a_team_that_forms_nothing_may_start_anywhere() -> None:
    assert told(APART, expect__converge="false") == []
