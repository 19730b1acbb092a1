"""Slow controllers: an answer comes when its step is over, and the agent takes nothing in."""

from hypothesis import given, settings
from hypothesis import strategies as st

from worldsim.engine.slow_controllers import SlowControllers
from worldsim.truth.world import Clock

CLOCK = Clock(20.0, 4)


@settings(derandomize=True, deadline=None)
@given(st.integers(0, 3), st.floats(0.001, 1.0))
def test_an_agent_takes_observations_only_when_its_answer_has_come(agent, delay_s):
    slow = SlowControllers(CLOCK, modelled=True)
    slow.begin(1, agent, delay_s)
    taken = []
    for slot in range(400):
        come = slow.answers(slot)
        assert len(come) <= 1
        if come:
            assert slot / 80.0 >= taken[-1] / 80.0 + delay_s - 1e-9
            assert (slot - 1) / 80.0 < taken[-1] / 80.0 + delay_s
        if CLOCK.steps(agent, slot) and slow.takes_observation(agent, slot):
            assert not taken or slot / 80.0 >= taken[-1] / 80.0 + delay_s - 1e-9
            assert slow.begin_step(agent, slot)[0] >= 80.0 * delay_s - 1e-6
            assert slow.hold(agent, None, b"")
            taken.append(slot)
    assert slow.struck == {1: len(taken)}
    assert len(taken) >= 400 // (80 * delay_s + 8)


def test_of_two_faults_the_longest_acts_and_a_step_that_has_begun_ends_in_its_time():
    slow = SlowControllers(CLOCK, modelled=True)
    slow.begin(1, 0, 0.2)
    slow.begin(2, 0, 0.5)
    assert slow.begin_step(0, 0) == (40, 0.0)
    slow.end(2, 0)
    slow.end(1, 0)
    assert not slow.takes_observation(0, 36)
    assert slow.takes_observation(0, 40)
    assert slow.begin_step(0, 40) == (0, 0.0)
    assert not slow
    assert slow.struck == {2: 1}


def test_where_processes_take_their_time_nothing_is_held():
    slow = SlowControllers(CLOCK, modelled=False)
    slow.begin(1, 0, 0.5)
    assert [slow.begin_step(0, slot) for slot in (0, 4)] == [(40, 0.5), (40, 0.5)]
    assert slow.takes_observation(0, 8)
    assert not slow.hold(0, None, b"")
    slow.end(1, 0)
    assert slow.is_late(0, 44)
    assert not slow.is_late(0, 49)
