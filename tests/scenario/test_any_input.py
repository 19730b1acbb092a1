"""Any content of a file gives a scenario, or an error of one line."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any, get_args

import msgspec
import pytest
import tomli_w
from hypothesis import given
from hypothesis import strategies as st

from worldsim.scenario.allowed_values import allowed
from worldsim.scenario.file import dump, load, parse
from worldsim.scenario.tables import Scenario
from worldsim.scenario.toml import ScenarioError

EVERYTHING = load(
    Path("deploy/scenarios/wedge-9.toml"),
    {
        "netem.link": "[{ from = 2, to = 5, loss_percent = 90 }]",
        "netem.multihop.loss_percent": "20",
        "control.cast_far_m": "0.5",
        "event": "[{ at_s = 1, kill = [2, 'random:1'], for_s = 2 },"
        " { at_s = 2, join = { count = 2 } },"
        " { at_s = 3, partition = [[0, 1]] }, { at_s = 4, heal = true },"
        " { at_s = 5, netem = { multihop = { delay_ms = 9 } } },"
        " { at_s = 6, frame = { yaw_deg = 9 } },"
        " { at_s = 7, formation = '../formations/three-horizontal-lines.toml' }]",
    },
)
Path_ = tuple[str | int, ...]

junk = st.recursive(
    st.none()
    | st.booleans()
    | st.integers(-(2**70), 2**70)
    | st.floats()
    | st.text(max_size=8)
    | st.sampled_from(["ray", "box", "list", "polyline", "helix", "curve", "V1", "q_structure"])
    | st.dates(),
    lambda inner: (
        st.lists(inner, max_size=4)
        | st.dictionaries(
            st.sampled_from(["kind", "name", "vertices", "direction", "a.b", "", "to"]),
            inner,
            max_size=3,
        )
    ),
    max_leaves=6,
)


def paths(data: Any, path: Path_ = ()) -> Iterator[Path_]:
    inner = data.items() if isinstance(data, dict) else enumerate(data)
    for key, value in inner:
        yield (*path, key)
        if isinstance(value, dict | list):
            yield from paths(value, (*path, key))


def without_none(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: without_none(inner) for key, inner in value.items() if inner is not None}
    return [without_none(each) for each in value if each is not None] if isinstance(
        value, list
    ) else value  # fmt: skip


@st.composite
def broken(draw: st.DrawFn) -> str:
    data = msgspec.toml.decode(dump(EVERYTHING))
    for _ in range(draw(st.integers(1, 2))):
        *where, last = draw(st.sampled_from(list(paths(data))))
        table = data
        for key in where:
            table = table[key]
        if draw(st.booleans()) and isinstance(table, dict):
            last = draw(st.sampled_from([last, f"{last}x", "file", "kind"]))
        table[last] = draw(junk)
    return tomli_w.dumps(without_none(data))


@given(broken())
def test_it_is_a_scenario_or_one_line(text: str) -> None:
    try:
        scenario = parse(text, "any.toml")
    except ScenarioError as error:
        assert str(error).startswith("any.toml: ")
        assert str(error).isprintable()
    else:
        assert parse(dump(scenario)) == scenario


@given(st.text(max_size=60))
def test_any_text_is_rejected_in_one_line(text: str) -> None:
    with pytest.raises(ScenarioError) as caught:
        parse(text, "any.toml")
    assert str(caught.value).isprintable()


def tables_within(kind: Any) -> Iterator[Any]:
    if isinstance(kind, type) and issubclass(kind, msgspec.Struct):
        yield kind
        for field in msgspec.structs.fields(kind):
            yield from tables_within(field.type)
    for inner in get_args(kind):
        yield from tables_within(inner)


def test_every_key_of_the_format_has_an_allowed_values_text() -> None:
    kinds = set(tables_within(Scenario))
    assert len(kinds) > 10
    for kind in kinds:
        for field in msgspec.structs.fields(kind):
            assert allowed(field.type)
