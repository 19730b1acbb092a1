"""Missions of one agent: none before one is heard, then the one with the highest key."""

import msgspec
import pytest

from agent.codec import encode_formation
from agent.comms.mission import KEYS_PER_VERSION, Missions
from agent.comms.reported_frame import MAX_EXTRAPOLATION_S
from agent.messages import AT_HOME, HOME, NO_MISSION, Drift, FramePath, Mission, Pose
from agent.qstructure.formation import FormationSpec
from agent.rejection import RejectedError
from tests.agent.comms.builders import heard_beacon

NOW_S = 3.0
PATH = FramePath(waypoints=((1.0, 0.0, 0.0), (9.0, 0.0, 0.0)), speed=0.5)
RAY = msgspec.convert(
    {
        "name": "ray",
        "vertices": {"V1": [0, 0, 0]},
        "queue": [
            {"name": "Q", "vertices": ["V1"], "shape": {"kind": "ray", "direction": [0, 1, 0]}}
        ],
    },
    FormationSpec,
)
SECOND = KEYS_PER_VERSION
DRIFTING = {"frame": Pose(7.0, 0.0, 0.0, 0.0), "drift": Drift(NOW_S, 0.5, 0.0, 0.0, 0.0)}


@pytest.fixture
def briefed():
    return Missions(0, RAY, 1.0, PATH)


@pytest.fixture
def unbriefed():
    return Missions(1, None, 1.0)


def hear(missions, teacher, sender=0, now_s=NOW_S):
    for piece in teacher.pieces():
        missions.receive(piece, sender, now_s)


def test_an_agent_that_is_not_briefed_flies_none_and_says_so(unbriefed):
    assert unbriefed.flown_at(NOW_S) is None
    assert (unbriefed.key, unbriefed.frame_key) == (NO_MISSION, NO_MISSION)
    assert unbriefed.frame_report(NOW_S) == (HOME, None)


def test_the_first_mission_is_newer_than_none(briefed, unbriefed):
    hear(unbriefed, briefed)
    known, heard = briefed.flown_at(NOW_S), unbriefed.flown_at(NOW_S)
    assert (heard.key, unbriefed.frame_key) == (0, 0)
    assert heard.frame.origin == known.frame.origin == (2.5, 0.0, 0.0)
    assert heard.formation.layout(5) == known.formation.layout(5)
    assert unbriefed.frame_report(NOW_S) == briefed.frame_report(NOW_S)


def test_what_was_heard_is_passed_on(briefed, unbriefed):
    hear(unbriefed, briefed)
    third = Missions(2, None, 1.0)
    hear(third, unbriefed, sender=1)
    assert third.flown_at(NOW_S) is not None
    assert third.pieces() == briefed.pieces()


def test_a_frame_without_any_mission_means_nothing(briefed, unbriefed):
    unbriefed.receive_frame(heard_beacon(0, 1, NOW_S, mission=SECOND, frame_key=SECOND, **DRIFTING))
    assert unbriefed.flown_at(NOW_S) is None
    assert unbriefed.frame_report(NOW_S) == (HOME, None)
    far_ahead = 40 * KEYS_PER_VERSION
    unbriefed.receive_frame(heard_beacon(0, 2, NOW_S, mission=far_ahead, frame_key=far_ahead))
    hear(unbriefed, briefed)
    assert unbriefed.flown_at(NOW_S).frame.origin == (2.5, 0.0, 0.0)


def test_with_an_older_mission_the_stamped_frame_is_flown_until_its_mission_comes(briefed):
    briefed.receive_frame(heard_beacon(1, 1, NOW_S, mission=SECOND, frame_key=SECOND, **DRIFTING))
    assert (briefed.key, briefed.frame_key) == (0, SECOND)
    assert briefed.flown_at(NOW_S + 2.0).frame.origin == (8.0, 0.0, 0.0)


def test_a_frame_that_is_heard_of_no_more_comes_to_rest_where_it_was_last_expected(briefed):
    briefed.receive_frame(heard_beacon(1, 1, NOW_S, mission=SECOND, frame_key=SECOND, **DRIFTING))
    moving = briefed.flown_at(NOW_S + MAX_EXTRAPOLATION_S).frame
    resting = briefed.flown_at(NOW_S + MAX_EXTRAPOLATION_S + 60.0).frame
    assert moving.moves
    assert not resting.moves
    assert resting.origin == moving.origin == (9.5, 0.0, 0.0)


def test_a_beacon_of_an_agent_without_a_mission_changes_nothing(briefed):
    before = briefed.flown_at(NOW_S)
    silent = heard_beacon(1, 1, NOW_S, mission=NO_MISSION, frame_key=NO_MISSION, **DRIFTING)
    briefed.receive_frame(silent)
    after = briefed.flown_at(NOW_S)
    assert (after.key, after.frame.origin) == (before.key, before.frame.origin)


def test_an_operators_order_reaches_an_agent_that_is_not_briefed(unbriefed):
    unbriefed.accept_order(Mission(key=0, frame=PATH, formation=encode_formation(RAY)))
    assert unbriefed.key == SECOND + 1
    assert unbriefed.flown_at(NOW_S).frame.origin == (2.5, 0.0, 0.0)


def test_an_order_of_a_frame_alone_needs_a_formation(briefed, unbriefed):
    frame_only = Mission(key=0, frame=AT_HOME, formation=b"")
    with pytest.raises(RejectedError) as refused:
        unbriefed.accept_order(frame_only)
    assert refused.value.cause == "mission"
    assert unbriefed.key == NO_MISSION
    briefed.accept_order(frame_only)
    assert briefed.flown_at(NOW_S).frame.origin == (0.0, 0.0, 0.0)
