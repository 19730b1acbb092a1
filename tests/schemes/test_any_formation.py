"""The schemes decide in every formation of the library, however the agents stand."""

from math import isfinite
from random import Random

import pytest

from agent.controller import load
from agent.messages import Place
from agent.qstructure.formation import formation_of
from agent.qstructure.target_frame import Frame
from tests.schemes.situations import SPACING_M, heard, senses, setup
from worldsim.scenario.file import load as load_scenario
from worldsim.scenario.library import SCENARIOS

SCHEMES = ("leader_follower", "virtual_structure", "former_q_structure", "printed_q_structure")
TEAM = 12
LIBRARY = (
    *("arcs-12", "figure-1a-12", "figure-1b-12", "helix-12", "horizontal-lines-12"),
    *("oriented-curve-10", "spline-12", "vertical-lines-12", "wedge-20", "zigzag-12"),
)


@pytest.mark.parametrize("scheme", SCHEMES)
@pytest.mark.parametrize("name", LIBRARY)
def test_a_scheme_decides_in_it(scheme, name):
    random = Random(f"{scheme} {name}")
    formation = formation_of(load_scenario(SCENARIOS / f"{name}.toml").formation, SPACING_M)
    places = [*formation.layout(TEAM).places, None]
    for own in (0, 1, TEAM - 1, TEAM):
        controller = load(scheme)(setup(own, TEAM))
        said = None
        for now_s in (0.0, 1.0, 1.05, 2.0, 5.0):
            frame = Frame(_point(random, 9.0), random.uniform(-3, 3), _point(random, 0.3), 0.1)
            others = [
                heard(k, _point(random, 4.0), random.choice(places), standing=said)
                for k in range(TEAM)
                if k != own and random.random() < 0.7
            ]
            at = senses(_point(random, 4.0), others, now_s, 1.0, frame=frame, formation=formation)
            intent = controller.decide(at)
            said = intent.words.standing
            numbers = (*intent.wanted, *intent.velocity, intent.yaw, *intent.heading_for)
            assert all(map(isfinite, (*numbers, intent.force)))
            assert intent.place is None or formation.slot(Place(*intent.place), TEAM) is not None


@pytest.mark.parametrize("scheme", SCHEMES)
def test_an_agent_alone_or_without_a_mission_hovers_or_leads(scheme):
    controller = load(scheme)(setup(0, 1))
    at = senses((1.0, 0.0, 0.0))
    for now_s in (0.0, 1.0):
        at.now_s = now_s
        intent = controller.decide(at)
    assert intent.place is not None
    at.mission = None
    assert controller.decide(at).place is None
    assert controller.decide(at).wanted == (0.0, 0.0, 0.0)


def _point(random, reach_m):
    return tuple(random.uniform(-reach_m, reach_m) for _ in range(3))
