"""The own clock: slots tell of its jumps, and an agent doubts it only where all contradict it."""

from hypothesis import given, settings
from hypothesis import strategies as st

from agent.comms.own_clock import CONTRADICTED_S, OwnClock

SLOT_S, SLACK_S = 0.0125, 0.1


@settings(derandomize=True, deadline=None)
@given(st.lists(st.tuples(st.integers(1, 400), st.floats(-200, 200)), min_size=1, max_size=20))
def test_a_clock_jumps_exactly_where_it_differs_from_the_slots(steps):
    clock = OwnClock(SLOT_S, SLACK_S)
    slot, time_s = 0, 1000.0
    assert not clock.jumps(slot, time_s)
    for slots, error_s in steps:
        slot, time_s = slot + slots, time_s + slots * SLOT_S + error_s
        assert clock.jumps(slot, time_s) == (abs(error_s) > SLACK_S + 1e-9) or (
            abs(abs(error_s) - SLACK_S) < 1e-6
        )


def test_a_clock_is_behind_while_two_others_are_ahead_and_none_agrees():
    clock = OwnClock(SLOT_S, SLACK_S)
    clock.contradict(1, 5.0)
    clock.contradict(1, 5.1)
    assert not clock.is_behind(5.1)
    clock.contradict(2, 5.2)
    assert clock.is_behind(5.2)
    assert not clock.is_behind(5.2 + CONTRADICTED_S + 0.1)


def test_one_agent_that_agrees_outweighs_all_that_contradict():
    clock = OwnClock(SLOT_S, SLACK_S)
    clock.confirm(5.0)
    for sender in range(8):
        clock.contradict(sender, 5.1)
    assert not clock.is_behind(5.2)
    for sender in range(8):
        clock.contradict(sender, 6.1)
    assert clock.is_behind(6.2)
    clock.confirm(6.2)
    assert not clock.is_behind(6.2)


def test_a_jump_ends_what_others_said_before():
    clock = OwnClock(SLOT_S, SLACK_S)
    clock.jumps(400, 5.0)
    clock.contradict(1, 5.0)
    clock.contradict(2, 5.0)
    assert clock.jumps(404, 8.05)
    assert not clock.is_behind(8.05)
