"""d_c2 follows the range of the radio where the scenario leaves it out (Lemma 7, E20)."""

from itertools import count
from math import dist, inf, pi, radians

import pytest

from agent.config import Control
from agent.controller import Flown, Link, Peer, Senses
from agent.guidance.bobber import bobber, cast_reach, cast_zone
from agent.guidance.cone import Cone
from agent.guidance.q_structure import QStructure
from agent.messages import ZERO
from agent.qstructure.formation import formation_of
from agent.qstructure.target_frame import Frame
from worldsim.scenario.file import parse

ALONE = """
fleet = { agents = 1 }
[formation]
name = "line"
vertices = { V1 = [0, 0, 0] }
queue = [{ name = "Q1", vertices = ["V1"], shape = { kind = "ray", direction = [1, 0, 0] } }]
"""


@pytest.mark.parametrize(
    ("range_m", "reach_m"),
    [
        (inf, 0.5),
        (60.0, 0.5),
        (3.0, 0.5),
        (2.0, 0.25),
        (1.6, 0.15),
        (1.4, 0.1),
        (0.3, 0.1),
        (0.0, 0.1),
    ],
)
def test_it_is_a_quarter_of_what_the_range_leaves_within_bounds(range_m, reach_m) -> None:
    assert cast_reach(Control(), range_m) == pytest.approx(reach_m)


def test_a_wider_spacing_leaves_less() -> None:
    assert cast_reach(Control(spacing_m=1.4), 2.0) == pytest.approx(0.15)


def test_it_is_at_least_twice_d_c1() -> None:
    assert cast_reach(Control(cast_near_m=0.2), 1.2) == pytest.approx(0.4)


@pytest.mark.parametrize(("heard_m", "reach_m"), [(0.7, 0.25), (2.4, 0.35), (9.0, 0.5)])
def test_a_range_that_is_only_heard_leaves_the_full_speed(heard_m, reach_m) -> None:
    assert cast_reach(Control(), heard_m, 0.25) == pytest.approx(reach_m)


def test_a_fast_vehicle_casts_no_farther_than_the_default() -> None:
    assert cast_reach(Control(), 0.7, 1.5) == 0.5


@pytest.mark.parametrize("range_m", [inf, 1.2, 9.0])
def test_a_given_one_stands(range_m) -> None:
    assert cast_reach(Control(cast_far_m=0.7), range_m) == 0.7


def test_a_shorter_range_casts_shorter() -> None:
    cone = Cone(radians(45), radians(45))
    for range_m in (1.5, 2.0, 2.5):
        reach = cast_reach(Control(), range_m)
        zone = cast_zone(cone, reach, 0.5, pi)
        x, _, _ = bobber((0.0, 0.0, 0.0), 0.0, (9.0, 0.0, 0.0), zone)
        assert x == pytest.approx(reach)


@pytest.mark.parametrize(("heard_m", "reach_m"), [(inf, 0.5), (2.4, 0.35), (0.7, 0.25)])
def test_an_agent_follows_the_range_that_it_has_heard(heard_m, reach_m) -> None:
    scenario = parse(ALONE)
    controller = QStructure(scenario.agent_setup(0, 0, 1))
    flown = Flown(0, formation_of(scenario.formation, 1.0), Frame(origin=(9.0, 0.0, 0.0)))
    peer, ticks = Peer(id=0, position=ZERO, place=None), count()
    intent = None
    while intent is None or intent.target is None:
        senses = Senses(
            now_s=next(ticks) / 20.0,
            position=ZERO,
            velocity=ZERO,
            yaw=0.0,
            vehicles=(),
            neighbours=(),
            team=lambda: (peer,),
            mission=flown,
            link=Link(loss=0.0, latency_s=0.0, reach_m=heard_m),
        )
        assert senses.now_s < 5.0, "it takes its place within 5 s"
        intent = controller.decide(senses)
    assert dist(intent.heading_for, ZERO) == pytest.approx(reach_m)
