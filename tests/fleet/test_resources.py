"""What the processes of a fleet use: CPU time between two moments, and memory."""

import os
import time

import pytest

from worldsim.fleet.culprits import SharedSteps
from worldsim.fleet.process_state import private_mb, process_state
from worldsim.fleet.resources import ResourceMeter


def test_without_a_page_of_steps_nothing_is_known() -> None:
    meter = ResourceMeter(None)
    meter.begin()
    meter.end(10)
    assert meter.row is None


def test_cpu_time_counts_from_the_beginning_for_each_part() -> None:
    steps = SharedSteps.of(2, 1)
    steps.page.note_pid(0, os.getpid())  # agent 1 and netem have not started
    meter = ResourceMeter(steps)
    meter.begin()
    until_s = time.process_time() + 0.05
    while time.process_time() < until_s:
        pass
    meter.end(100)
    assert meter.row is not None
    used = meter.row["cpu_us_per_agent_step"]
    # Both are this process. /proc counts in 10 ms, and may count on between the two readings.
    assert used["world"] == pytest.approx(used["agents"], abs=100.0)
    assert used["agents"] >= 300.0
    assert used["netem"] == 0.0
    assert meter.row["agent_steps"] == 100
    assert meter.row["start_up_s"] is None
    assert meter.row["agent_private_mb"] == pytest.approx(private_mb(os.getpid()), rel=0.1)


def test_a_process_that_is_gone_has_neither_state_nor_memory() -> None:
    gone = os.posix_spawn("/bin/true", ["true"], {})
    os.waitpid(gone, 0)
    assert (process_state(gone), private_mb(gone), process_state(0)) == (None, None, None)
