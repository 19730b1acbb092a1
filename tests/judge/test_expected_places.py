"""The judge's own reading of a formation: it agrees with the agents', and does not depend on it."""

from dataclasses import replace
from random import Random

import msgspec
import numpy as np
import pytest

from agent.messages import Place
from agent.qstructure.formation import Formation, FormationSpec, Layout, Slot, formation_of
from tests.recording.flights import straight_flight, wedge
from worldsim.judge.expected_places import MATCH_M, ExpectedPlaces
from worldsim.judge.verdict import Judge
from worldsim.scenario.file import formation_tables
from worldsim.scenario.library import find_formation
from worldsim.search.draws import Draw
from worldsim.search.formations import FALLBACK, drawn, fits, library

SPACING_M = 1.0
NOTHING: frozenset[Place] = frozenset()


def agreement(spec: FormationSpec, teams: range, random: Random) -> int:
    """Compare all places of some teams, with and without blocked ones; return how many teams."""
    formation, expected, compared = (
        formation_of(spec, SPACING_M),
        ExpectedPlaces(spec, SPACING_M),
        0,
    )
    for agents in teams:
        places = sorted(formation.layout(agents).places)
        for blocked in (NOTHING, frozenset(random.sample(places, min(2, len(places))))):
            slots = [slot.point for slot in formation.layout(agents, blocked).slots.values()]
            assert expected.are(slots, blocked) or len(slots) < agents, (spec.name, agents, blocked)
            compared += expected.points(agents, blocked) is not None
    return compared


@pytest.mark.parametrize("name", library())
def test_agents_and_judge_agree_on_every_formation_of_the_library(name: str) -> None:
    tables = formation_tables(find_formation(name))
    spec = msgspec.convert(tables, FormationSpec)
    assert agreement(spec, range(1, 40), Random(1)) == 2 * 39


def test_agents_and_judge_agree_on_random_formations() -> None:
    compared = 0
    for seed in range(150):
        draw = Draw(seed)
        tables = drawn(draw, 9, SPACING_M)
        if fits(tables, 9, SPACING_M, 0.3):
            spec = msgspec.convert(tables, FormationSpec)
            compared += agreement(spec, range(1, 10), Random(seed)) > 0
    assert compared > 75


def misplaced(layout: Layout) -> Layout:
    """Return a layout whose last place is 0.2 m off."""
    last = layout.places[-1]
    x, y, z = layout.slots[last].point
    wrong = Slot((x, y, z + 0.2), layout.slots[last].arc_length, layout.slots[last].attitude)
    return layout._replace(slots={**layout.slots, last: wrong})


@pytest.mark.pure
def test_a_team_that_computes_a_place_wrongly_does_not_converge(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    scenario, right = wedge(9, duration_s=12.0), Formation._layout
    for wrong in (False, True):
        if wrong:
            monkeypatch.setattr(
                Formation, "_layout", lambda *given: misplaced(right(*given)), raising=True
            )
        monkeypatch.setattr("worldsim.judge.verdict.formation_of", Formation)
        judge = Judge(scenario)
        for tick in straight_flight(scenario):
            judge.see(tick)
        assert judge.phases[0].residual_m < 0.01  # each stands where agents think it must
        assert (judge.phases[0].converge_s is None) == wrong


def test_a_team_with_a_gap_in_a_queue_does_not_converge() -> None:
    """On an open queue every rank is a slot; a gap would look like a formation otherwise."""
    scenario = wedge(9, duration_s=12.0)
    formation = formation_of(scenario.formation, SPACING_M)
    judge = Judge(scenario)
    for tick in straight_flight(scenario):
        place, position = tick.place.copy(), tick.position.copy()
        last = int(np.argmax(place[:, 1]))
        place[last, 1] += 1
        behind = formation.slot(Place(*place[last].tolist()), 9)
        assert behind is not None
        position[last] = behind.point
        judge.see(replace(tick, place=place, position=position))
    assert judge.phases[0].residual_m < 0.01
    assert judge.phases[0].converge_s is None


def test_it_has_no_opinion_on_a_curve_that_it_cannot_measure() -> None:
    curve = {"kind": "curve", "x": "floor(s)", "y": "s", "z": "0"}
    table = {**FALLBACK["queue"][0], "shape": curve}
    spec = msgspec.convert({**FALLBACK, "queue": [table]}, FormationSpec)
    expected = ExpectedPlaces(spec, SPACING_M)
    assert expected.points(9, NOTHING) is None
    assert expected.are([(0.0, 0.0, 0.0)] * 9, NOTHING)


def test_two_slots_at_one_place_are_not_the_places() -> None:
    expected = ExpectedPlaces(msgspec.convert(FALLBACK, FormationSpec), SPACING_M)
    points = [tuple(each) for each in expected.points(3, NOTHING).tolist()]
    assert expected.are(points, NOTHING)
    assert expected.are(points[::-1], NOTHING)
    assert not expected.are([points[0], points[0], points[2]], NOTHING)
    assert not expected.are([points[0], points[1], (points[2][0] - 1.5 * MATCH_M, 0, 0)], NOTHING)
