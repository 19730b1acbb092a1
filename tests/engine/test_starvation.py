"""CPU starvation: a process runs for its share of each period, and pauses are left alone."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.engine.test_timeline_effects import carried_out
from worldsim.engine.operations import PauseProcesses, ResumeProcesses, ThrottleProcesses
from worldsim.engine.starvation import Share, Starvation

RUNNING = np.ones(4, dtype=np.bool_)
SLOTS = 8000


@settings(derandomize=True, deadline=None, max_examples=30)
@given(st.integers(1, 99), st.sampled_from([0.1, 0.25, 0.5, 1.0, 2.0]), st.integers(0, 50))
def test_a_process_runs_for_its_share_and_first_in_each_period(percent, period_s, since):
    starvation, since_s = Starvation(), since / 10.0
    starvation.begin(1, 2, Share(since_s, percent, period_s))
    ran = 0
    for slot in range(SLOTS):
        change = starvation.change(since_s + slot / 80.0, RUNNING)
        if change is not None:
            starvation.apply(change)
        in_period_s = slot / 80.0 % period_s
        near = min(in_period_s, period_s - in_period_s) < 1e-6
        if near:
            assert starvation.stopped == frozenset()
        ran += 2 not in starvation.stopped
    slots_a_period = 80.0 * period_s
    assert abs(ran / SLOTS - 0.01 * percent) <= 1.0 / slots_a_period + 0.01


def test_a_starved_process_is_stopped_and_continued_and_at_the_end_runs():
    operations = carried_out("at_s = 1\nfor_s = 1\nstarve = { agents = [1], cpu_percent = 20 }")
    throttles = [(t, o) for t, o in operations if isinstance(o, ThrottleProcesses)]
    assert [(round(t, 4), o.stops, o.continues) for t, o in throttles] == [
        (1.1, (1,), ()),
        (1.5, (), (1,)),
        (1.6, (1,), ()),
        (2.0, (), (1,)),
    ]


def test_a_paused_process_is_neither_stopped_nor_continued():
    operations = carried_out(
        "at_s = 1\nfor_s = 4\nstarve = { agents = [1], cpu_percent = 20 }",
        "at_s = 2.2\nfor_s = 1.1\npause = [1]",
    )
    while_paused = [o for t, o in operations if 2.2 < t < 3.3]
    assert while_paused == []
    kinds = [type(o) for t, o in operations if 2.15 < t < 3.35]
    assert kinds == [PauseProcesses, ResumeProcesses, ThrottleProcesses]


def test_of_two_faults_each_stops_a_process_and_counts_its_steps():
    starvation = Starvation()
    starvation.begin(1, 0, Share(0.0, 50, 1.0))
    starvation.begin(2, 0, Share(0.25, 50, 1.0))
    stopped = []
    for slot in range(80):
        change = starvation.change(slot / 80.0, RUNNING)
        if change is not None:
            starvation.apply(change)
        if starvation.suppresses(0, slot / 80.0):
            stopped.append(slot)
    assert stopped == [*range(20), *range(40, 80)]
    assert starvation.struck == {1: 40, 2: 40}
    starvation.end(1, 0)
    starvation.end(2, 0)
    last = starvation.change(1.0, RUNNING)
    assert last is not None
    assert last.continues == (0,)
    starvation.apply(last)
    assert not starvation
