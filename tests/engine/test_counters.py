"""Counters of a run: direct links and bytes sent, for each agent."""

import numpy as np

from agent.messages import CAUSES, Command, Telemetry
from netem.messages import MediumCounters
from worldsim.engine.counters import Links, RadioUse, RejectionCounters

COUNTERS = MediumCounters(
    slot=0,
    sent=0,
    addressed=0,
    fates={},
    in_flight=0,
    rejected={},
    sent_b=(100, 10, 400, 40, 0, 0),
)


def rejecting(incarnation: int, count: int) -> Command:
    """Return a command of an agent that has rejected so many messages for the first cause."""
    zero = (0.0, 0.0, 0.0)
    telemetry = Telemetry(zero, 0.0, None, None, (), ((0, count),), 0, -1, -1, 0)
    return Command(8, incarnation, 16, zero, 0.0, (0.0, 0.0), telemetry)


def radio_use() -> RadioUse:
    """Return 2 s in which agent 0 runs, agent 1 runs for the first second, and agent 2 never."""
    use = RadioUse(3, tick_hz=20.0)
    for tick in range(40):
        use.count_tick(np.array([True, tick < 20, False]))
        use.count_step(0, 2 if tick < 10 else 1, 1 if tick < 30 else None)
    use.count_step(1, 1, None)
    return use


def test_direct_links_are_the_mean_and_the_most_over_an_agents_steps() -> None:
    assert radio_use().heard() == Links(mean=[1.25, 1.0, None], most=[2, 1, None])


def test_needed_links_are_counted_over_the_steps_with_a_place() -> None:
    assert radio_use().needed() == Links(mean=[1.0, None, None], most=[1, None, None])


def test_bytes_count_per_second_in_which_an_agent_was_running() -> None:
    assert radio_use().bytes_per_s(COUNTERS) == {
        "local": [50.0, 400.0, None],
        "multihop": [5.0, 40.0, None],
    }


def test_without_counters_of_the_medium_there_are_no_bytes() -> None:
    assert radio_use().bytes_per_s(None) is None


def test_rejections_of_replaced_processes_stay_counted() -> None:
    counters = RejectionCounters()
    for incarnation in range(50):
        for count in (1, 2, 3):
            counters.update(0, rejecting(incarnation, count))
    assert counters.by_cause() == {CAUSES[0]: 150}
