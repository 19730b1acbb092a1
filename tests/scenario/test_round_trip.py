"""A resolved scenario is a scenario: parsing what is dumped gives an equal one."""

from typing import Any

import msgspec
from hypothesis import given
from hypothesis import strategies as st

from worldsim.scenario.file import dump, parse
from worldsim.scenario.tables import Scenario

names = st.text(min_size=1, max_size=12)
metres = st.floats(-1e3, 1e3)
triples = st.tuples(metres, metres, metres).map(list)
directions = triples.filter(lambda v: max(map(abs, v[1:])) > 1e-3)


def link_keys() -> st.SearchStrategy[dict[str, Any]]:
    return st.fixed_dictionaries(
        {},
        optional={
            "range_m": st.floats(0.1, 1e3),
            "delay_ms": st.floats(0, 1e3),
            "jitter_ms": st.floats(0, 1e3),
            "loss_percent": st.floats(0, 100),
        },
    )


@st.composite
def formations(draw: st.DrawFn) -> dict[str, Any]:
    chosen = draw(st.lists(names, min_size=1, max_size=4, unique=True))
    apart = draw(st.floats(20.5, 100))
    vertices = {name: [apart * index, 0.0, -apart] for index, name in enumerate(chosen)}
    queues = [
        {
            "name": f"{index} {draw(names)}",
            "vertices": [vertex],
            "shape": {"kind": "ray", "direction": [0.0, *draw(directions)[1:]]},
        }
        for index, vertex in enumerate(vertices)
    ]
    return {"name": draw(names), "vertices": vertices, "queue": queues}


@st.composite
def scenarios(draw: st.DrawFn) -> Scenario:
    agents = draw(st.integers(4, 12))
    spread = draw(st.floats(0.5, 10))
    listed = {"kind": "list", "positions_m": [[spread * i, 0.0, -spread] for i in range(agents)]}
    boxed = {"kind": "box", "centre_m": draw(triples), "spacing_m": draw(st.floats(0.25, 2))}
    links = draw(st.sets(st.tuples(st.integers(0, 3), st.integers(0, 3)), max_size=4))
    data = {
        "name": draw(st.from_regex(r"\A[A-Za-z0-9][A-Za-z0-9._-]{0,20}\Z")),
        "seed": draw(st.integers(0, 2**53 - 1)),
        "duration_s": draw(st.floats(0.1, 1e4)),
        "fleet": {"agents": agents, "start": draw(st.sampled_from([listed, boxed]))},
        "formation": draw(formations()),
        "control": {"spacing_m": draw(st.floats(0.5, 10))},
        "netem": {
            **draw(link_keys()),
            "local": draw(link_keys()),
            "link": [{**draw(link_keys()), "from": a, "to": b} for a, b in links if a != b],
        },
        "expect": draw(
            st.fixed_dictionaries({}, optional={"converge_within_s": st.floats(0.1, 1e3)})
        ),
    }
    return msgspec.convert(data, Scenario)


@given(scenarios())
def test_parsing_a_dumped_scenario_gives_it_back(scenario: Scenario) -> None:
    text = dump(scenario)
    assert parse(text) == scenario
    assert dump(parse(text)) == text


def test_defaults_are_written_and_missing_values_are_not() -> None:
    text = dump(parse("fleet = { agents = 1 }\n[formation]\n" + ONE_QUEUE))
    assert "max_speed_mps = 0.5" in text
    assert "direction = [0.0, 0.0, 1.0]" in text
    assert "cast_far_m" not in text


ONE_QUEUE = """
name = "one"
vertices = { V1 = [0, 0, 0] }
queue = [{ name = "Q", vertices = ["V1"], shape = { kind = "ray", direction = [0, 0, 1] } }]
"""
