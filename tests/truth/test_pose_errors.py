"""Poses measured wrong: biases add up and end by themselves, noise is keyed, yaw turns all axes."""

from math import dist, hypot, pi, radians

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from worldsim.truth.pose_errors import PoseError, PoseErrors

HERE = (1.0, 2.0, 3.0)
biases = st.tuples(*[st.integers(-10, 10)] * 3)


@settings(derandomize=True, deadline=None)
@given(st.lists(biases, min_size=1, max_size=5), st.randoms(use_true_random=False))
def test_biases_add_up_and_end_in_any_order(given_biases, random):
    errors, left = PoseErrors(1), dict(enumerate(given_biases))
    for number, bias in left.items():
        errors.begin(number, 3, PoseError(bias, 0.0, 0.0))
    while left:
        expected = tuple(np.array(HERE) + np.sum(list(left.values()), axis=0))
        assert errors.measured(3, HERE, 0.5, 7) == (expected, 0.5)
        assert errors.measured(4, HERE, 0.5, 7) == (HERE, 0.5)
        ends = random.choice(list(left))
        del left[ends]
        errors.end(ends, 3)
    assert not errors


def test_the_noise_is_keyed_by_seed_agent_and_slot_and_has_its_deviation():
    errors, again, other = PoseErrors(1), PoseErrors(1), PoseErrors(2)
    for each in (errors, again, other):
        each.begin(0, 3, PoseError((0.0, 0.0, 0.0), 0.3, 0.0))
        each.begin(1, 3, PoseError((0.0, 0.0, 0.0), 0.4, 0.0))
    drawn = np.array([errors.measured(3, HERE, 0.0, slot).position for slot in range(2000)])
    assert errors.measured(3, HERE, 0.0, 11) == again.measured(3, HERE, 0.0, 11)
    assert errors.measured(3, HERE, 0.0, 11) != other.measured(3, HERE, 0.0, 11)
    assert np.std(drawn - HERE, axis=0) == pytest.approx([0.5] * 3, rel=0.06)
    assert np.mean(drawn - HERE, axis=0) == pytest.approx([0.0] * 3, abs=0.04)


@settings(derandomize=True, deadline=None)
@given(st.floats(-pi, pi), st.floats(-5, 5), st.floats(-5, 5))
def test_what_is_measured_and_what_is_flown_turn_against_each_other(yaw, x, y):
    errors = PoseErrors(1)
    errors.begin(0, 0, PoseError((0.0, 0.0, 0.0), 0.0, yaw))
    turned = errors.turned(0, (x, y, 1.0))
    assert hypot(*turned) == pytest.approx(hypot(x, y, 1.0))
    assert dist(errors.turned_back(0, turned), (x, y, 1.0)) < 1e-12
    assert errors.turned(1, (x, y, 1.0)) == (x, y, 1.0)


def test_a_measured_yaw_stays_within_a_turn_and_is_turned_back():
    errors = PoseErrors(1)
    errors.begin(0, 0, PoseError((0.0, 0.0, 0.0), 0.0, radians(-90)))
    assert errors.measured(0, HERE, 0.0, 1).yaw == pytest.approx(1.5 * pi)
    assert errors.yaw_back(0, 1.5 * pi) == pytest.approx(0.0, abs=1e-12)
