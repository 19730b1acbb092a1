"""Clocks that are wrong: the errors of faults in force add up, and each ends by itself."""

from hypothesis import given, settings
from hypothesis import strategies as st

from worldsim.truth.agent_clocks import AgentClocks, ClockError

errors = st.builds(
    ClockError,
    since_s=st.integers(0, 50),
    offset_s=st.integers(-100, 100),
    drift_ppm=st.integers(-10_000, 10_000),
)


@settings(derandomize=True, deadline=None)
@given(st.lists(errors, min_size=1, max_size=5), st.randoms(use_true_random=False))
def test_errors_add_up_and_end_in_any_order(given_errors, random):
    clocks, left = AgentClocks(), dict(enumerate(given_errors))
    for number, error in left.items():
        clocks.begin(number, 3, error)
    while left:
        expected_s = sum(
            each.offset_s + each.drift_ppm * 1e-6 * (60.0 - each.since_s) for each in left.values()
        )
        assert abs(clocks.ahead_s(3, 60.0) - expected_s) < 1e-9
        assert clocks.ahead_s(4, 60.0) == 0.0
        ends = random.choice(list(left))
        del left[ends]
        clocks.end(ends, 3)
    assert not clocks
    assert clocks.shown_s(3, 60.0) == 60.0


def test_each_fault_counts_the_wrong_times_that_it_gave():
    clocks = AgentClocks()
    clocks.begin(1, 0, ClockError(0.0, 2.0, 0.0))
    clocks.begin(2, 0, ClockError(5.0, 0.0, 100.0))
    assert [clocks.shown_s(0, t) for t in (5.0, 15.0)] == [7.0, 17.001]
    assert clocks.struck == {1: 2, 2: 1}


def test_no_clock_shows_less_than_zero():
    clocks = AgentClocks()
    clocks.begin(1, 0, ClockError(0.0, -5.0, 0.0))
    assert clocks.shown_s(0, 3.0) == 0.0
