"""The point of a moving frame that an agent without a mission holds."""

from math import pi

import pytest

from agent.controller import HeardFrame, Senses
from agent.guidance.held_point import HeldPoint
from agent.messages import REACH_M, ZERO
from agent.qstructure.target_frame import Frame

AWAY = (2.0, 1.0, 0.5)
PLACE = (-1.0, 1.0, 0.5)
"""The same point in a frame at x = 3 m."""


def senses(frame, position=AWAY, key=0):
    heard = HeardFrame(key, frame) if frame is not None else None
    return Senses(1.0, position, ZERO, 0.0, (), (), tuple, None, heard_frame=heard)


def frame_at(x_m, yaw=0.0, speed=0.3, yaw_rate=0.0):
    return Frame((x_m, 0.0, 0.0), yaw, (speed, 0.0, 0.0), yaw_rate)


def target(held, *args, **kwargs):
    return held.target(senses(*args, **kwargs))[0]


def test_without_a_frame_it_stays_where_it_is():
    held = HeldPoint()
    for position in (AWAY, ZERO):
        point, frame = held.target(senses(None, position))
        assert point == position
        assert not frame.moves


def test_it_holds_the_point_at_which_it_first_heard_of_the_frame():
    held, moving = HeldPoint(), frame_at(3.0)
    assert held.target(senses(moving)) == (AWAY, moving)
    assert target(held, frame_at(3.5), (2.1, 1.0, 0.5)) == pytest.approx((2.5, 1.0, 0.5))
    assert target(held, frame_at(3.5, 0.2), ZERO) == pytest.approx(
        frame_at(3.5, 0.2).to_world(PLACE)
    )
    stopped = frame_at(3.5, speed=0.0)
    assert target(held, stopped, ZERO) == pytest.approx((2.5, 1.0, 0.5))


def test_when_no_frame_is_heard_any_more_it_stays_and_then_holds_that_point():
    held = HeldPoint()
    held.target(senses(frame_at(3.0)))
    assert target(held, None, ZERO) == ZERO
    assert target(held, frame_at(9.0), ZERO) == pytest.approx(ZERO)


def test_it_insists_on_no_point_that_others_need():
    held, aside = HeldPoint(), (2.0, 1.5, 0.5)
    held.target(senses(frame_at(3.0)))
    held.give_way()
    assert target(held, frame_at(3.0), aside) == pytest.approx(aside)
    assert target(held, frame_at(3.1), ZERO) == pytest.approx((2.1, 1.5, 0.5))


def test_a_newer_mission_takes_it_along_but_a_contradiction_does_not():
    held = HeldPoint()
    held.target(senses(frame_at(3.0)))
    assert target(held, frame_at(9.0)) == pytest.approx(AWAY), (
        "a second frame of the same mission moves the point"
    )
    assert target(held, frame_at(3.0), key=1) == pytest.approx((-4.0, 1.0, 0.5))
    assert target(held, frame_at(3.0), key=0) == pytest.approx(AWAY), (
        "an older mission moves the point"
    )


OUT_OF_REACH = frame_at(1.1 * REACH_M)
FLUNG = [frame_at(3.0, yaw_rate=70.0), frame_at(3.0, pi, yaw_rate=-70.0)]


@pytest.mark.parametrize("frame", [OUT_OF_REACH, *FLUNG], ids=["far", "flung", "flung back"])
def test_it_holds_no_point_that_could_be_no_slot(frame):
    point, at_rest = HeldPoint().target(senses(frame))
    assert point == AWAY
    assert not at_rest.moves


@pytest.mark.parametrize("frame", FLUNG)
def test_it_lets_go_of_a_point_that_is_flung(frame):
    held = HeldPoint()
    held.target(senses(frame_at(3.0)))
    assert target(held, frame, key=1) == AWAY
    assert target(held, frame_at(4.0), key=1) == pytest.approx(AWAY)
