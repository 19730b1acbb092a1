"""Queues: the members' positions along a curve with one vertex or several."""

from itertools import pairwise
from math import dist, pi

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from agent.qstructure.orientation import Orientation, OrientationSpec
from agent.qstructure.queue import Queue, QueueError
from agent.qstructure.shape import Arc, Curve, Polyline, Ray, Straight, shape_of

WITHIN_M = 1e-3


def straight(*vertices, spacing=1.0):
    return Queue("Q", list(vertices), Straight(list(vertices)), spacing)


def circle(spacing=1.0):
    """Return a queue on half a circle of 3 m about the origin, with a vertex half way."""
    vertices = [(3.0, 0.0, 0.0), (0.0, 3.0, 0.0), (-3.0, 0.0, 0.0)]
    return Queue("Q", vertices, shape_of(Arc(3.0, 180.0, 90.0)), spacing)


def gaps(queue, count):
    """Return the arc lengths between neighbours, vertices included [m]."""
    return [b - a for a, b in pairwise(sorted([*queue.stations, *queue.members(count)]))]


def test_an_open_queue_has_no_end():
    queue = Queue("Q", [(1.0, 2.0, 3.0)], shape_of(Ray((0.0, 0.0, 2.0))), 0.7)
    assert not queue.closed
    assert queue.room is None
    assert queue.members(3) == pytest.approx([0.7, 1.4, 2.1])
    assert queue.point(2.1) == pytest.approx((1.0, 2.0, 5.1))


def test_a_closed_queue_passes_through_its_vertices():
    queue = circle()
    assert queue.stations == pytest.approx([0.0, 1.5 * pi, 3.0 * pi], abs=WITHIN_M)
    for station, vertex in zip(queue.stations, [(3, 0, 0), (0, 3, 0), (-3, 0, 0)], strict=True):
        assert dist(queue.point(station), vertex) < WITHIN_M


def test_members_stand_evenly_between_two_vertices():
    queue = straight((0.0, 0.0, 0.0), (10.0, 0.0, 0.0))
    for count in range(1, 10):
        assert gaps(queue, count) == pytest.approx([10.0 / (count + 1)] * (count + 1))


@given(
    lengths=st.lists(st.floats(1.0, 12.0), min_size=1, max_size=5),
    spacing=st.floats(0.5, 1.0),
    share=st.floats(0.0, 1.0),
)
@settings(deadline=None)
def test_segments_of_any_length_fill_evenly_and_never_too_closely(lengths, spacing, share):
    corners = [(0.0, 0.0, 0.0)]
    for index, length in enumerate(lengths):
        x, y, z = corners[-1]
        corners.append((x + length, y, z) if index % 2 else (x, y + length, z))
    queue = straight(*corners, spacing=spacing)
    count = int(share * queue.room)
    members = queue.members(count)
    assert len(members) == count
    assert members == sorted(members)
    assert min(gaps(queue, count), default=spacing) >= spacing - 1e-6
    for start, end in pairwise(queue.stations):
        inside = [start, *(s for s in members if start < s < end), end]
        steps = [b - a for a, b in pairwise(inside)]
        assert max(steps) - min(steps) < 1e-6


def test_the_longer_segment_gets_more():
    queue = straight((0.0, 0.0, 0.0), (2.0, 0.0, 0.0), (2.0, 6.0, 0.0))
    members = queue.members(3)
    assert sum(s > 2.0 for s in members) == 3
    assert queue.room == 1 + 5
    assert sum(s < 2.0 for s in queue.members(6)) == 1


def test_members_of_a_full_queue_are_d_ir_apart():
    queue = circle()
    assert queue.room == 6
    assert min(gaps(queue, 6)) >= 1.0


def test_a_closed_queue_follows_its_shape():
    queue = Queue(
        "Q",
        [(1.0, 1.0, 0.0), (1.0 + pi, 1.0, 0.0)],
        shape_of(Curve("s", "sin(s)", "0")),
        0.8,
    )
    assert queue.stations[1] == pytest.approx(3.8202, abs=WITHIN_M)
    x, y, _ = queue.point(queue.members(1)[0])
    assert (x, y) == pytest.approx((1.0 + pi / 2, 2.0), abs=WITHIN_M)


REJECTED = {
    "misses its vertex": ([(0, 0, 0), (2.0, 0.5, 0.0)], Ray((1.0, 0.0, 0.0)), "shape", "misses"),
    "runs the other way": ([(0, 0, 0), (-2.0, 0, 0)], Ray((1.0, 0.0, 0.0)), "shape", "misses"),
    "too short": ([(0, 0, 0), (0.9, 0, 0)], Ray((1.0, 0.0, 0.0)), "vertices", "too short"),
    "passes them in another order": (
        [(0, 0, 0), (4.0, 0, 0), (2.0, 0, 0)],
        Polyline(((0.0, 0.0, 0.0), (2.0, 0.0, 0.0), (6.0, 0.0, 0.0))),
        "shape",
        "misses",
    ),
}


@pytest.mark.parametrize(("vertices", "shape", "key", "text"), REJECTED.values(), ids=REJECTED)
def test_a_queue_that_cannot_hold_members_is_rejected(vertices, shape, key, text):
    with pytest.raises(QueueError, match=text) as rejected:
        Queue("Q", vertices, shape_of(shape), 1.0)
    assert rejected.value.key == key


def test_angles_follow_the_arc_length_and_omitted_angles_are_free():
    turning = Orientation(OrientationSpec(yaw_deg="10*d", roll_deg=-5))
    queue = Queue("Q", [(0, 0, 0)], shape_of(Ray((0, 3, 0))), 0.5, turning)
    for s in queue.members(5):
        yaw, pitch, roll = queue.attitude(s)
        assert yaw == pytest.approx(s * 10.0 * pi / 180.0)
        assert pitch is None
        assert roll == pytest.approx(-5.0 * pi / 180.0)
    assert straight((0, 0, 0), (5, 0, 0)).attitude(1.0) == (None, None, None)
