"""The warm-up before agents are forked: it runs an agent's code and leaves nothing else behind."""

import threading
from pathlib import Path

from worldsim.bench.fleets import wedge
from worldsim.engine.virtual import fly
from worldsim.fleet.warm_up import AGENTS, warm_up


def trace_of_a_flight():
    return fly(wedge(3, 1.0)).loop.trace.sha256


def descriptors():
    return len(list(Path("/proc/self/fd").iterdir()))


def test_a_warm_process_flies_as_before():
    cold = trace_of_a_flight()
    warm_up()
    assert trace_of_a_flight() == cold


def test_the_agents_of_the_warm_up_hear_each_other():
    for agent, command in enumerate(warm_up()):
        others = tuple(other for other in range(AGENTS) if other != agent)
        assert command.telemetry.heard == others
        assert command.telemetry.rejected == ()


def test_no_thread_and_no_descriptor_is_left():
    before = threading.active_count(), descriptors()
    warm_up()
    assert (threading.active_count(), descriptors()) == before
