"""``check`` warns of queues that stay empty in a team."""

from worldsim.scenario.file import parse
from worldsim.scenario.rules import warnings_for

FORK = """
duration_s = 20.0
[fleet]
agents = 4
[formation]
name = "fork"
vertices = { V1 = [0, 0, 0] }
queue = [
    { name = "long", vertices = ["V1"], shape = { kind = "ray", direction = [1, 0, 0] } },
    { name = "short", vertices = ["V1"], shape = { kind = "ray", direction = [-1, 0, 0] } },
]
[netem]
range_m = 9.0
"""


def warned(text: str = FORK, **overrides: str) -> list[tuple[str, str]]:
    found = warnings_for(
        parse(text, overrides={key.replace("__", "."): value for key, value in overrides.items()})
    )
    return [(each.key, each.detail) for each in found]


def with_capacities(long: float, short: float) -> str:
    longer = FORK.replace('"long",', f'"long", capacity = {long},')
    return longer.replace('"short",', f'"short", capacity = {short},')


def test_queues_that_somebody_flies_in_are_no_problem() -> None:
    assert warned() == []
    assert warned(with_capacities(0.8, 0.2)) == []


def test_a_share_of_nobody_is_named_with_its_queue() -> None:
    ((key, detail),) = warned(with_capacities(0.9, 0.1))
    assert key == "formation.queue[1].capacity"
    assert "'short' stays empty: 3 agents" in detail
    assert "its share of 0.1" in detail
    assert warned(with_capacities(0.9, 0.1), fleet__agents="10") == []


def test_a_team_smaller_than_its_queues_leaves_some_empty() -> None:
    assert [key for key, _ in warned(fleet__agents="2")] == ["formation.queue[1].capacity"]


def test_a_later_formation_is_filled_with_those_who_join() -> None:
    start = "{ kind = 'box', centre_m = [0, 9, 0] }"
    arms = """
        at_s = 5, formation = { name = "arms", vertices = { V1 = [0, 0, 0] }, queue = [
        { name = "a", vertices = ["V1"], shape = { kind = "ray", direction = [1, 0, 0] } },
        { name = "b", vertices = ["V1"], shape = { kind = "ray", direction = [0, 1, 0] } },
        { name = "c", vertices = ["V1"], shape = { kind = "ray", direction = [0, -1, 0] } },
        { name = "d", vertices = ["V1"], shape = { kind = "ray", direction = [-1, 0, 0] } } ] }
    """.replace("\n", "")
    join = f"at_s = 3, join = {{ count = 1, start = {start} }}"
    alone, together = f"[{{ {arms} }}]", f"[{{ {join} }}, {{ {arms} }}]"
    assert [key for key, _ in warned(event=alone)] == ["event[0].formation.queue[3].capacity"]
    assert warned(event=together) == []
