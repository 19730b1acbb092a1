"""A line flies as a whole: along its displacement, below its speed, and clear of other lines."""

from itertools import pairwise
from math import dist, hypot, inf

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from agent.messages import ZERO, Line
from agent.structure.line import (
    centimetres,
    clear_displacement,
    displacement_of,
    flight_s,
    has_arrived,
    has_left,
    room_between,
)
from agent.structure.tree import version_at

STEPS = 100
ways = st.tuples(*[st.floats(-40.0, 40.0)] * 3).filter(lambda way: hypot(*way) > 0.5)
ROW = [(-1.0, 0.0, 0.0), (-2.0, 0.0, 0.0), (-3.0, 0.0, 0.0)]
BESIDE = [(x, 1.5, 0.0) for x, _, _ in ROW]


def line(way, leaves_s=5.0, speed_mps=0.4):
    arrives_s = leaves_s + flight_s(hypot(*way), speed_mps)
    return Line(0, 0, *centimetres(way), version_at(leaves_s), version_at(arrives_s))


@settings(derandomize=True)
@given(ways, st.floats(0.05, 3.0))
def test_a_line_stays_until_it_leaves_and_then_flies_to_its_queue_below_its_speed(way, speed_mps):
    flown = line(way, speed_mps=speed_mps)
    whole = displacement_of(flown, 0.0)
    assert dist(whole, way) < 0.01
    assert displacement_of(flown, 5.0) == whole
    step_s = flight_s(hypot(*way), speed_mps) / STEPS
    at = [displacement_of(flown, 5.0 + step_s * step) for step in range(STEPS + 2)]
    assert at[-1] == ZERO
    for before, after in pairwise(at):
        assert hypot(*after) <= hypot(*before)
        assert dist(before, after) <= 1.02 * speed_mps * step_s
        assert hypot(*after) == pytest.approx(
            sum(a * b for a, b in zip(after, whole, strict=True)) / hypot(*whole)
        ), "it leaves the straight way"


def test_a_line_speeds_up_slowly():
    flown = line((8.0, 0.0, 0.0))
    assert dist(displacement_of(flown, 5.5), (8.0, 0.0, 0.0)) < 0.03


def test_before_and_after_its_flight():
    flown = line((8.0, 0.0, 0.0))
    arrives_s = 5.0 + flight_s(8.0, 0.4)
    assert [has_left(flown, s) for s in (4.9, 5.0, arrives_s)] == [False, True, True]
    assert [has_arrived(flown, s) for s in (5.0, arrives_s - 0.1, arrives_s)] == [
        False,
        False,
        True,
    ]


def test_a_line_without_time_for_its_flight_is_there_at_once():
    flown = Line(0, 0, 800, 0, 0, 500, 500)
    assert displacement_of(flown, 5.0) == (8.0, 0.0, 0.0)
    assert displacement_of(flown, 5.01) == ZERO


@settings(derandomize=True)
@given(ways, ways)
def test_a_line_keeps_as_clear_of_another_as_their_queues_are(way, other):
    """Two queues 1.5 m apart can always keep 0.75 m: with one displacement they keep 1.5 m."""
    found, room_m = clear_displacement(way, ROW, [(other, BESIDE)], 0.75)
    assert room_m >= 0.75
    assert room_between(found, ROW, [(other, BESIDE)]) == room_m
    if room_between(way, ROW, [(other, BESIDE)]) >= 0.75:
        assert found == way


def test_where_nothing_is_clear_the_roomiest_is_taken():
    others = [((0.0, y, 0.0), ROW) for y in (-0.4, 0.0, 0.4)]
    found, room_m = clear_displacement(ZERO, ROW, others, 0.75)
    assert 0.0 < room_m < 0.75
    assert room_between(found, ROW, others) == room_m >= room_between(ZERO, ROW, others)
    assert clear_displacement(ZERO, ROW, [], 0.75) == (ZERO, inf)
