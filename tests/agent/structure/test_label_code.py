"""The code of a label tells a member's queue, and where along it the member joined."""

from random import Random

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from agent.structure.label_code import FIRST_VERTEX, LabelCodes, of_vertex, queue_of_code
from tests.agent.structure.builders import LIBRARY, LINE, library, rays

MAPS = {path.stem: library(path) for path in LIBRARY}


@pytest.mark.parametrize("name", MAPS)
@pytest.mark.parametrize("ids", [1, 9, 200])
def test_a_code_tells_the_queue_of_any_member_anywhere(name, ids):
    formation, random = MAPS[name], Random(ids)
    codes = LabelCodes(formation, ids)
    for _ in range(200):
        queue = random.randrange(formation.queues)
        here = tuple(random.uniform(-99.0, 99.0) for _ in range(3))
        assert queue_of_code(codes.of_queue(queue, here), formation.queues) == queue


def test_a_vertex_has_a_code_of_no_queue():
    assert all(queue_of_code(of_vertex(v), 3) == -1 for v in range(16))
    assert of_vertex(0) == FIRST_VERTEX


@settings(derandomize=True, deadline=None)
@given(st.floats(-4.0, 12.0), st.floats(-4.0, 12.0), st.floats(-5.0, 5.0), st.floats(-5.0, 5.0))
def test_codes_never_contradict_the_order_along_the_queue(near_m, far_m, beside_m, above_m):
    codes = LabelCodes(LINE, 9)
    near, far = sorted((near_m, far_m))
    first = codes.of_queue(0, (-near, beside_m, 0.0))
    assert first <= codes.of_queue(0, (-far, 0.0, above_m))


def test_members_a_place_apart_have_different_codes():
    codes = LabelCodes(rays((-1.0, 1.0, 0.0), (-1.0, -1.0, 0.0)), 20)
    at = [codes.of_queue(0, (-0.7 * k, 0.7 * k, 0.0)) for k in range(11)]
    assert at == sorted(set(at))


@pytest.mark.parametrize(
    ("here", "along"),
    [
        ((0.0, 3.0, 0.0), 0.0),
        ((-1.0, 0.0, 0.0), 1.0),
        ((-2.5, -4.0, 1.0), 2.5),
        ((2.0, 1.0, 0.0), -2.0),
        ((-9.0, 0.0, 0.0), 9.0),
    ],
)
def test_along_counts_the_places_from_the_home_and_goes_on_beyond_both_ends(here, along):
    assert LINE.along(0, 5, here) == pytest.approx(along)
