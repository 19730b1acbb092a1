"""The library's formations are those of Fig. 8, and the team divides over them by E16."""

from math import dist, sqrt
from pathlib import Path

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from agent.messages import Place, Vector
from agent.qstructure.formation import Formation, FormationSpec, QueueSpec
from agent.qstructure.shape import Ray
from worldsim.scenario.file import load
from worldsim.scenario.library import FORMATIONS, SCENARIOS
from worldsim.scenario.rules import warnings_for

FILES = sorted(SCENARIOS.rglob("*.toml"))
EDGE = 1.0 / sqrt(3.0)


def formation(name: str) -> Formation:
    spec = msgspec.toml.decode((FORMATIONS / f"{name}.toml").read_bytes(), type=FormationSpec)
    return Formation(spec, spacing=1.0)


def slot(team: Formation, queue: int, rank: int) -> Vector:
    found = team.slot(Place(queue, rank), agents=20)
    assert found is not None
    return found.point


@pytest.mark.parametrize("file", FILES, ids=lambda file: file.stem)
def test_every_scenario_is_valid_without_warnings_and_named_as_its_file(file: Path) -> None:
    scenario = load(file)
    assert scenario.name == file.stem
    assert warnings_for(scenario) == []


@pytest.mark.parametrize("file", sorted(FORMATIONS.rglob("*.toml")), ids=lambda file: file.stem)
def test_every_formation_is_valid_and_named_as_its_file(file: Path) -> None:
    assert formation(file.stem).name == file.stem


def test_wedge_9_is_the_documented_example() -> None:
    scenario = load(SCENARIOS / "wedge-9.toml")
    assert (scenario.fleet.agents, scenario.duration_s, scenario.netem.range_m) == (9, 20.0, 6.0)
    assert scenario.expect.converge_within_s == 12.0


def test_the_wedge_runs_back_from_its_apex_along_four_edges() -> None:
    wedge = formation("pyramidal-wedge")
    ends = {slot(wedge, queue, 1) for queue in range(4)}
    corners = [(-EDGE, y * EDGE, z * EDGE) for y in (-1, 1) for z in (-1, 1)]
    assert len(ends) == 4
    assert all(min(dist(end, corner) for end in ends) < 1e-12 for corner in corners)
    assert wedge.layout(9).places[0] == wedge.vertex_places["V1"]


@pytest.mark.parametrize(
    ("name", "step"),
    [("three-horizontal-lines", (-1, 0, 0)), ("three-vertical-lines", (0, 0, 1))],
)
def test_the_lines_are_parallel_and_1_5_m_apart(name: str, step: tuple[int, int, int]) -> None:
    lines = formation(name)
    for queue, y in enumerate((-1.5, 0.0, 1.5)):
        assert slot(lines, queue, 0) == (0.0, y, 0.0)
        assert slot(lines, queue, 2) == (2.0 * step[0], y, 2.0 * step[2])


@pytest.mark.parametrize(
    ("name", "agents", "counts"),
    [
        ("pyramidal-wedge", 9, (2, 2, 2, 2)),
        ("pyramidal-wedge", 6, (2, 1, 1, 1)),
        ("pyramidal-wedge", 1, (0, 0, 0, 0)),
        ("three-horizontal-lines", 6, (2, 2, 2)),
        ("three-vertical-lines", 7, (3, 2, 2)),
    ],
)
def test_the_numbers_of_e16(name: str, agents: int, counts: tuple[int, ...]) -> None:
    assert formation(name).divide(agents) == counts


@st.composite
def divided(draw: st.DrawFn, sharing: tuple[bool, ...] = (False, True)) -> tuple[Formation, int]:
    weights = draw(st.lists(st.integers(1, 50), min_size=1, max_size=8))
    shared = draw(st.sampled_from(sharing))
    vertices = {f"V{j}": (0.0, float(j), 0.0) for j in range(1 if shared else len(weights))}
    queues = tuple(
        QueueSpec(f"Q{j}", ("V0" if shared else f"V{j}",), Ray((1.0, 0.0, 0.0)), w / sum(weights))
        for j, w in enumerate(weights)
    )
    return Formation(FormationSpec("f", vertices, queues), 1.0), draw(st.integers(0, 200))


@given(divided())
def test_every_agent_gets_exactly_one_place(case: tuple[Formation, int]) -> None:
    team, agents = case
    common = min(agents, len(team.common))
    assert sum(team.divide(agents)) + common == agents
    layout = team.layout(agents)
    assert len(set(layout.places)) == len(layout.places) == agents
    assert set(layout.places) == layout.slots.keys()
    assert layout.unplaced == 0


@given(divided(sharing=(True,)))
def test_each_queue_gets_its_share_rounded_down_or_up(case: tuple[Formation, int]) -> None:
    team, agents = case
    free = max(0, agents - len(team.common))
    for capacity, count in zip(team.capacities, team.divide(agents), strict=True):
        assert abs(count - capacity * free) < 1.0 + 1e-6


@given(divided(sharing=(False,)))
def test_every_vertex_is_filled_before_a_second_slot_is(
    case: tuple[Formation, int],
) -> None:
    team, agents = case
    counts = team.divide(agents)
    assert agents < len(counts) or min(counts) >= 1


@given(divided(sharing=(True,)))
def test_queues_with_the_larger_remainders_are_rounded_up(case: tuple[Formation, int]) -> None:
    team, agents = case
    free = max(0, agents - len(team.common))
    rests = [
        (capacity * free - count, count >= capacity * free - 1e-6)
        for capacity, count in zip(team.capacities, team.divide(agents), strict=True)
    ]
    short = [rest for rest, full in rests if not full]
    raised = [rest + 1.0 for rest, full in rests if full and rest < -1e-6]
    assert not short or not raised or max(short) <= min(raised) + 1e-6
