"""Wall time: when slots are due after a stall, and which ticks count as late."""

import pytest

from agent.messages import Command, Telemetry
from worldsim.fleet.pacing import LatenessCounter, Pacer


class Clock:
    def __init__(self) -> None:
        self.now_s = 100.0

    def __call__(self) -> float:
        return self.now_s


def command(slot: int) -> Command:
    zero = (0.0, 0.0, 0.0)
    telemetry = Telemetry(zero, 0.0, None, None, (), (), 0, -1, -1, 0)
    return Command(slot, 0, slot + 8, zero, 0.0, (0.0, 0.0), telemetry)


def test_the_pacer_catches_up_less_than_a_slot_and_skips_longer_stalls() -> None:
    clock = Clock()
    pacer = Pacer(0.0125, clock)
    pacer.start()
    assert pacer.left_s(4) == pytest.approx(0.05)
    clock.now_s += 0.06
    pacer.begin(4)  # 0.01 s late: caught up
    assert pacer.left_s(5) == pytest.approx(0.0025)
    clock.now_s += 1.0
    pacer.begin(5)  # a stall of a second: not caught up
    assert pacer.left_s(6) == pytest.approx(0.0125)
    assert pacer.elapsed_s == pytest.approx(1.06)


def test_a_change_of_pace_moves_no_slot_that_is_due_already() -> None:
    clock = Clock()
    pacer = Pacer(0.0125, clock)
    pacer.start()
    pacer.change(4, 0.05)
    assert pacer.left_s(4) == pytest.approx(0.05)
    assert pacer.left_s(5) == pytest.approx(0.1)
    clock.now_s += 0.12
    pacer.begin(5)  # 0.02 s late: caught up
    pacer.change(6, 0.025)
    assert pacer.left_s(6) == pytest.approx(0.03)
    assert pacer.left_s(8) == pytest.approx(0.08)
    clock.now_s += 1.08
    pacer.begin(8)  # a stall of a second at the new pace
    assert pacer.left_s(9) == pytest.approx(0.025)


def test_a_tick_is_late_when_its_command_is_missing_at_the_next_observation() -> None:
    lateness = LatenessCounter(2)
    assert lateness.late_fraction is None
    lateness.observe(0, 0, None)
    lateness.observe(0, 4, command(0))
    assert lateness.late_fraction == 0.0
    lateness.observe(0, 8, command(0))
    assert lateness.late_fraction == 0.5
    lateness.observe(1, 1, None)
    lateness.observe(1, 5, None)
    assert lateness.late_fraction == pytest.approx(2 / 3)


def test_no_command_is_expected_for_observations_before_an_agent_stopped() -> None:
    lateness = LatenessCounter(2)
    lateness.observe(0, 0, None)
    lateness.observe(0, 4, command(0))
    lateness.observe(1, 1, None)
    lateness.drop_pending([1])
    lateness.observe(1, 80, None)
    assert lateness.late_fraction == 0.0
    lateness.observe(1, 84, None)
    assert lateness.late_fraction == 0.5
