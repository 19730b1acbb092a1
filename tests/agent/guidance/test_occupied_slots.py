"""Places that bodies take: who stands in one has it, and one that was left is not had at once."""

import pytest

from agent.controller import Flown, Peer, Senses
from agent.guidance.occupied_slots import FREED_S, GROWN_S, Blocked
from agent.guidance.target_on_queue import TargetOnQueue
from agent.messages import Place
from agent.qstructure.formation import Formation, FormationSpec, QueueSpec
from agent.qstructure.shape import Ray
from agent.qstructure.target_frame import Frame

LINE = Formation(
    FormationSpec(
        "line",
        {"V1": (0.0, 0.0, 0.0)},
        (QueueSpec(name="Q1", vertices=("V1",), shape=Ray(direction=(-1.0, 0.0, 0.0))),),
    ),
    1.0,
)
MISSION = Flown(0, LINE, Frame((0.0, 0.0, 0.0), 0.0))
SECOND, THIRD = Place(0, 1), Place(0, 2)
ME = Peer(0, (0.0, 0.0, 0.0), Place(0, 0))
FAR = Peer(1, (-5.0, 0.0, 0.0), THIRD)
START_S = 10.0


def senses(now_s, silent=(), vehicles=(), told=frozenset(), at=ME.position):
    still = (0.0, 0.0, 0.0)
    team, parts = tuple, (now_s, at, still, 0.0, tuple(vehicles), ())
    return Senses(*parts, team, MISSION, tuple(silent), frozenset(told))


@pytest.fixture
def blocked():
    made = Blocked(TargetOnQueue(0, 1.0), sees=True)
    assert made.now(senses(START_S - GROWN_S), (ME, FAR)) == frozenset()
    return made


def test_a_body_near_a_place_takes_it(blocked):
    assert blocked.now(senses(START_S, silent=[(-1.1, 0.3, 0.0)]), (ME, FAR)) == {SECOND}
    assert blocked.seen == (SECOND,)


def test_who_stands_in_a_place_has_it_whoever_comes_near(blocked):
    holder = Peer(1, (-1.05, 0.0, 0.0), SECOND)
    near = senses(START_S, silent=[(-1.2, 0.3, 0.0)], told={SECOND})
    assert blocked.now(near, (ME, holder)) == frozenset()
    assert blocked.seen == ()


def test_a_place_that_a_body_has_left_is_not_had_again_at_once(blocked):
    blocked.now(senses(START_S, silent=[(-1.0, 0.0, 0.0)]), (ME, FAR))
    assert blocked.now(senses(START_S + 0.9 * FREED_S), (ME, FAR)) == {SECOND}
    assert blocked.seen == ()
    assert blocked.now(senses(START_S + 1.1 * FREED_S), (ME, FAR)) == frozenset()


def test_nor_while_somebody_unknown_is_on_its_way_there(blocked):
    blocked.now(senses(START_S, silent=[(-1.0, 0.0, 0.0)]), (ME, FAR))
    for step in range(1, 5):
        coming = senses(START_S + 0.5 * step * FREED_S, vehicles=[(-1.4, 0.0, 0.0)])
        assert blocked.now(coming, (ME, FAR)) == {SECOND}
        assert blocked.seen == (SECOND,)


def test_a_body_that_turns_out_to_be_a_member_blocks_nothing(blocked):
    blocked.now(senses(START_S, silent=[(-1.0, 0.0, 0.0)]), (ME, FAR))
    grown = (ME, FAR, Peer(2, (-1.0, 0.0, 0.0), None))
    assert blocked.now(senses(START_S + 0.2), grown) == frozenset()


def test_what_others_tell_of_is_believed_unless_one_would_see_it(blocked):
    assert blocked.now(senses(START_S, told={SECOND, THIRD}), (ME, FAR)) == {THIRD}
