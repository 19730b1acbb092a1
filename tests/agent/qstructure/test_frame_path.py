"""The frame's path: continuous in time, at its speed, and at rest in the end."""

from math import dist, hypot, pi

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from agent.messages import AT_HOME, FramePath
from agent.qstructure.frame_path import Track, tip_speed

STEP_S = 0.05
metres = st.integers(-20, 20).map(float)
waypoints = st.lists(st.tuples(metres, metres, metres), min_size=2, max_size=6, unique=True)
paths = st.builds(
    FramePath,
    waypoints=waypoints.map(tuple),
    speed=st.floats(0.5, 2.0),
    start_s=st.floats(0.0, 10.0),
    yaw=st.floats(-3.0, 3.0),
    turn_rate=st.sampled_from([0.0, 0.5, 2.0]),
    waits_s=st.lists(st.floats(0.0, 3.0), max_size=6).map(tuple),
)


@settings(derandomize=True, deadline=None, max_examples=50)
@given(paths)
def test_it_never_jumps_and_its_velocity_is_true(path):
    track, moved_m, last = Track(path), 0.0, Track(path).at(0.0)
    for tick in range(1, int(track.arrives_s / STEP_S) + 3):
        frame = track.at(tick * STEP_S)
        step_m = dist(frame.origin, last.origin)
        assert step_m <= path.speed * STEP_S + 1e-9
        assert abs(frame.yaw - last.yaw) <= path.turn_rate * STEP_S + 1e-9
        assert hypot(*frame.velocity) == pytest.approx(path.speed) or not any(frame.velocity)
        moved_m, last = moved_m + step_m, frame
    assert dist(last.origin, path.waypoints[-1]) < 1e-6
    assert not last.moves


def test_it_waits_turns_on_the_spot_and_goes_on():
    path = FramePath(
        waypoints=((0.0, 0.0, 0.0), (2.0, 0.0, 0.0), (2.0, 1.0, 0.0)),
        speed=0.5,
        start_s=1.0,
        turn_rate=pi / 4,
    )
    track = Track(path)
    assert track.at(0.5).origin == (0.0, 0.0, 0.0)
    assert track.at(3.0).origin == pytest.approx((1.0, 0.0, 0.0))
    assert track.at(6.0).origin == pytest.approx((2.0, 0.0, 0.0))
    assert track.at(6.0).yaw == pytest.approx(pi / 4)
    assert track.at(8.0).origin == pytest.approx((2.0, 0.5, 0.0))
    assert track.arrives_s == pytest.approx(9.0)


def test_a_slot_moves_with_the_frame_and_turns_with_it():
    path = FramePath(
        waypoints=((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (1.0, 1.0, 0.0)), speed=0.5, turn_rate=0.2
    )
    track = Track(path)
    for time_s in (0.5, 3.0, 5.0, 11.0):
        frame, later = track.at(time_s), track.at(time_s + 1e-6)
        here, there = frame.to_world((-1.0, 2.0, 0.5)), later.to_world((-1.0, 2.0, 0.5))
        seen = tuple((b - a) / 1e-6 for a, b in zip(here, there, strict=True))
        assert frame.velocity_at(here) == pytest.approx(seen, abs=1e-5)


def test_with_one_waypoint_it_rests_and_no_tip_moves():
    assert Track(AT_HOME).rests
    assert tip_speed(AT_HOME, 5.0) == 0.0
