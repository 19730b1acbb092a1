"""An agent without a mission follows the frame of members with a tier, and only for a time."""

import pytest

from agent.codec import encode_formation
from agent.comms.mission import FIRST_VERSIONS, KEYS_PER_VERSION, Missions
from agent.comms.reported_frame import MAX_EXTRAPOLATION_S
from agent.messages import HOME, NO_MISSION, Branch, Drift, Mission, Pose, RootKey, Standing
from agent.rejection import RejectedError
from tests.agent.comms.builders import heard_beacon
from tests.agent.comms.test_mission import NOW_S, PATH, RAY, SECOND

ALONG_X = (0.3, 0.0, 0.0, 0.0)


def standing(*tiers):
    """Return the standing of an agent with these tiers in the trees; None: of no known root."""
    branches = [None if tier is None else Branch(RootKey(0, 2), 1, tier, -1) for tier in tiers]
    return Standing(tuple(branches), -1, 0, 1, False, None, None, 1)


def report(sender, stamp_s, x_m, drift=ALONG_X, **fields):
    """Return a beacon of an agent of tier 1 that reports a frame at x; drift None: at rest."""
    made = {"standing": standing(1), "frame": Pose(x_m, 0.0, 0.0, 0.0), **fields}
    moving = None if drift is None else Drift(made.pop("of_s", stamp_s), *drift)
    return heard_beacon(sender, 1, stamp_s, drift=moving, **made)


@pytest.fixture
def missions():
    return Missions(1, None, 1.0)


def x_at(missions, time_s):
    heard = missions.heard_frame_at(time_s)
    return heard.frame.origin[0] if heard is not None else None


@pytest.mark.parametrize("believed", [standing(0), standing(3), standing(None, -1, 2)], ids=str)
def test_the_frame_of_a_neighbour_with_a_tier_is_taken_and_extrapolated(missions, believed):
    missions.receive_frame(report(0, NOW_S, 7.0, standing=believed))
    assert x_at(missions, NOW_S) == 7.0
    assert x_at(missions, NOW_S + 2.0) == pytest.approx(7.6)
    heard = missions.heard_frame_at(NOW_S)
    assert (heard.key, heard.frame.velocity) == (0, (0.3, 0.0, 0.0))


@pytest.mark.parametrize("said", [None, standing(), standing(-1), standing(None, -1)], ids=str)
def test_the_frame_of_a_neighbour_without_a_tier_is_not(missions, said):
    missions.receive_frame(report(0, NOW_S, 7.0, standing=said))
    assert missions.heard_frame_at(NOW_S) is None


def test_a_neighbour_without_a_frame_gives_none(missions):
    missions.receive_frame(report(0, NOW_S, 7.0, frame_key=NO_MISSION))
    assert missions.heard_frame_at(NOW_S) is None


@pytest.mark.parametrize("drift", [ALONG_X, None], ids=["moving", "at rest"])
def test_it_counts_for_as_long_as_a_member_extrapolates(missions, drift):
    missions.receive_frame(report(0, NOW_S, 7.0, drift))
    assert missions.heard_frame_at(NOW_S + MAX_EXTRAPOLATION_S) is not None
    assert missions.heard_frame_at(NOW_S + MAX_EXTRAPOLATION_S + 0.1) is None
    missions.receive_frame(report(0, NOW_S + 6.0, 9.0, drift))
    assert x_at(missions, NOW_S + 6.0) == 9.0


def test_the_newest_stamp_wins_whoever_reports_it(missions):
    missions.receive_frame(report(0, NOW_S, 7.0))
    missions.receive_frame(report(2, NOW_S + 1.0, 7.2, of_s=NOW_S - 0.5))
    assert x_at(missions, NOW_S + 1.0) == pytest.approx(7.3)
    missions.receive_frame(report(3, NOW_S + 1.0, 7.5))
    assert x_at(missions, NOW_S + 1.0) == 7.5


def test_the_highest_key_wins_while_it_is_heard(missions):
    missions.receive_frame(report(0, NOW_S, 7.0, frame_key=SECOND))
    missions.receive_frame(report(2, NOW_S + 1.0, 1.0))
    assert missions.heard_frame_at(NOW_S + 1.0).key == SECOND
    later_s = NOW_S + MAX_EXTRAPOLATION_S + 0.1
    missions.receive_frame(report(2, later_s, 1.5))
    assert (missions.heard_frame_at(later_s).key, x_at(missions, later_s)) == (0, 1.5)


def test_a_report_that_no_longer_counts_displaces_none(missions):
    missions.receive_frame(report(0, 20.0, 7.0))
    missions.receive_frame(report(2, 20.0, 1.0, of_s=1.0, frame_key=SECOND))
    assert x_at(missions, 20.0) == 7.0


def test_it_reports_nothing_that_it_only_heard(missions):
    missions.receive_frame(report(0, NOW_S, 7.0))
    assert missions.flown_at(NOW_S) is None
    assert (missions.key, missions.frame_key) == (NO_MISSION, NO_MISSION)
    assert missions.frame_report(NOW_S) == (HOME, None)


def test_with_a_mission_its_own_frame_is_the_only_one(missions):
    missions.receive_frame(report(0, NOW_S, 7.0, frame_key=9 * SECOND))
    missions.accept_order(Mission(key=0, frame=PATH, formation=encode_formation(RAY)))
    assert missions.heard_frame_at(NOW_S) is None
    assert missions.flown_at(NOW_S).frame.origin == (2.5, 0.0, 0.0)


def test_a_frame_of_the_future_or_of_an_impossible_mission_is_rejected(missions):
    with pytest.raises(RejectedError, match="later than the beacon's"):
        missions.receive_frame(report(0, NOW_S, 7.0, of_s=NOW_S + 1.0))
    too_many = (FIRST_VERSIONS + 100) * KEYS_PER_VERSION
    with pytest.raises(RejectedError, match="so many missions"):
        missions.receive_frame(report(0, NOW_S, 7.0, frame_key=too_many))
    assert missions.heard_frame_at(NOW_S) is None
