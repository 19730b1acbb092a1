"""What this host has, and what it can fly, from what was measured."""

from worldsim.doctor import capacity
from worldsim.doctor.capacity import Capacity, agents_in_real_time, process_check, virtual_check
from worldsim.doctor.checks import clock_check

FREE = Capacity(cpu_us=750.0, cores=2.0, others=0.0, late_percent=0.0)


def test_the_fleet_that_keeps_up_uses_three_quarters_of_the_cores() -> None:
    # 20 steps of 750 us are 15 ms of a second; 1.5 cores hold 100 of them.
    assert agents_in_real_time(750.0, 2.0) == FREE.agents == FREE.agents_now == 100
    assert process_check(FREE).says.startswith("about 100 agents in real time at 20 Hz (run)")
    assert process_check(FREE).hint == ""


def test_other_programs_leave_less() -> None:
    hint = process_check(FREE._replace(others=1.5, late_percent=12.0)).hint
    assert hint.startswith("1.5 cores are busy with other programs: about 25 at present; 12 %")


def test_virtual_time_is_told_in_real_time() -> None:
    assert "at 100 x real time" in virtual_check(100 * capacity.AGENTS * 20.0).says


def test_a_clock_that_wakes_late_is_told() -> None:
    assert clock_check([0.0001] * 9 + [0.0031]).hint == ""
    late = clock_check([0.0001] * 9 + [0.02])
    assert "wakes 0.1 ms late, 20.0 at worst" in late.says
    assert late.hint == "the host is busy: expect late ticks"
