"""The library: every scenario can be flown, and the small ones meet their expectations."""

from collections import Counter
from functools import cache
from math import cos, dist, hypot, sin
from pathlib import Path

import pytest

from agent.messages import Place
from agent.qstructure.formation import Formation
from worldsim.engine.preflight import PROCESS_COMMAND_TICKS, admit
from worldsim.engine.virtual import Flight, fly
from worldsim.scenario.file import load
from worldsim.scenario.tables import Scenario

DEPLOY = Path(__file__).parents[2] / "deploy"
GALLERY = {file.stem: file for file in sorted((DEPLOY / "scenarios").glob("*.toml"))}
LARGE = 13
"""From this number of agents on, a run takes too long for a test."""
FLOWN_ELSEWHERE = ("wedge-9", "field-6")
"""test_wedge.py and test_moving.py fly these with several seeds, the file's own one too."""


def scenario(name: str) -> Scenario:
    return load(GALLERY[name])


@cache
def flown(name: str) -> Flight:
    return fly(scenario(name))


def places(name: str) -> list[Place]:
    commands = flown(name).loop.world.latest
    told = [command.telemetry.place for command in commands if command is not None]
    return [Place(*place) for place in told if place is not None]


def formation(name: str) -> Formation:
    return Formation(scenario(name).formation, scenario(name).control.spacing_m)


SMALL = [
    name for name in GALLERY if scenario(name).fleet.agents < LARGE and name not in FLOWN_ELSEWHERE
]


@pytest.mark.parametrize("name", GALLERY)
def test_a_scenario_passes_the_preflight_and_has_a_description(name: str) -> None:
    admit(scenario(name), GALLERY[name], PROCESS_COMMAND_TICKS)
    first = GALLERY[name].read_text().splitlines()[0]
    assert first.startswith("# ")
    assert len(first) <= 105


def test_every_formation_of_the_library_is_flown() -> None:
    library = {file.stem for file in (DEPLOY / "formations").glob("*.toml")}
    assert library <= {scenario(name).formation.name for name in GALLERY}


@pytest.mark.parametrize("name", SMALL)
def test_a_scenario_meets_its_expectations(name: str) -> None:
    judge = flown(name).loop.judge
    assert [each for each in judge.expectations() if not each.held] == []
    assert all(row.ticks and not row.violations for row in judge.invariants().values())


@pytest.mark.parametrize("name", ["figure-1a-12", "figure-1b-12"])
def test_each_queue_of_fig_1_has_the_members_of_its_capacity(name: str) -> None:
    team = formation(name)
    held = places(name)
    assert sorted(held) == sorted(team.layout(12).places)
    own = Counter(place.queue for place in held if place not in team.common)
    assert tuple(own[queue] for queue in range(len(team.queues))) == team.divide(12)


def test_on_the_oriented_curve_every_agent_takes_the_attitude_of_its_slot() -> None:
    missed_deg = flown("oriented-curve-10").loop.judge.attitude_error_deg
    assert missed_deg is not None
    assert missed_deg < 2.0


def test_slots_of_the_oriented_curve_are_1_m_apart_along_it() -> None:
    slots = [slot.point for slot in formation("oriented-curve-10").layout(10).slots.values()]
    along_m = []
    for x, y, z in sorted(slots, key=lambda point: point[2]):
        s = (z + 1.0) / 0.3
        assert dist((x, y), (2.0 * cos(s) - 2.0, 2.0 * sin(s))) < 0.001
        along_m.append(hypot(2.0, 0.3) * s)
    assert along_m == pytest.approx(range(10), abs=0.001)


def test_queues_that_gather_stand_long_before_the_whole_formation() -> None:
    """Without gathering the lead is a few seconds: see docs/method.md."""
    (queues,) = flown("gather-12").loop.judge.sub_formations
    assert queues.lead_s is not None
    assert queues.lead_s > 12.0
    assert sorted(places("gather-12")) == sorted(formation("gather-12").layout(12).places)


def test_a_flock_settles_at_about_spacing_m_between_neighbours() -> None:
    spacing_m = scenario("flocking-9").control.spacing_m
    position = flown("flocking-9").loop.world.vehicles.position.tolist()
    for agent, here in enumerate(position):
        nearest_m = min(dist(here, there) for row, there in enumerate(position) if row != agent)
        assert 0.9 * spacing_m < nearest_m < 1.15 * spacing_m
