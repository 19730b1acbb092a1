"""A team is timed only while no fault in force forbids it to form."""

from collections.abc import Sequence
from dataclasses import replace

import msgspec
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.judge.test_held_formation import FLIGHT, JAM, WINDOW_S, Off, away, radio, rows, still
from tests.recording.flights import straight_flight
from worldsim.judge.asked_time import AskedTime
from worldsim.judge.finding import Expectation
from worldsim.judge.run_events import (
    ClockChanged,
    Killed,
    PoseChanged,
    Restarted,
    RunEvent,
    SlowChanged,
)
from worldsim.judge.verdict import Judge

CONVERGE = f"converge {FLIGHT.formation.name}"
Row = tuple[float | None, bool | None]
"""What an expectation got, and whether it is held."""


def pose(from_s: float, to_s: float | None = None) -> list[RunEvent]:
    fault = PoseChanged(t_s=from_s, agent=0, planned=True, number=7, bias_m=(0.0, 0.0, 0.5))
    ends = [] if to_s is None else [msgspec.structs.replace(fault, t_s=to_s, ends=True)]
    return [fault, *ends]


def kill(t_s: float) -> Killed:
    return Killed(t_s=t_s, agent=4, planned=True)


def judged(off_m: Off, events: Sequence[RunEvent], within_s: float | None = None) -> Judge:
    expect = msgspec.structs.replace(FLIGHT.expect, converge_within_s=within_s)
    flight = msgspec.structs.replace(FLIGHT, expect=expect)
    judge, waiting = Judge(flight), sorted(events, key=lambda event: event.t_s)
    for tick in straight_flight(flight):
        while waiting and waiting[0].t_s <= tick.time_s:
            judge.handle_event(waiting.pop(0))
        position = tick.position + off_m(tick.time_s) * np.eye(5, 1) * np.array([[0, 0, 1.0]])
        judge.see(replace(tick, position=position))
    return judge


def found(row: Expectation) -> Row:
    return (None if row.got is None else round(row.got, 1), row.held)


@pytest.mark.parametrize(
    ("events", "within_s", "expected"),
    [
        ([], 8.0, (None, False)),
        (pose(1.0), 8.0, (None, None)),
        (pose(1.0), None, (None, None)),
        (radio((1.0, 0, JAM)), 8.0, (None, None)),
        (
            [ClockChanged(t_s=1.0, agent=0, planned=True, number=7, offset_s=3.0)],
            8.0,
            (None, None),
        ),
        (pose(9.0), 8.0, (None, False)),  # the limit was over before the fault
        (pose(1.0, 15.0), 8.0, (None, None)),  # 5 s are left
        (pose(1.0, 15.0), 4.0, (None, False)),
        (pose(1.0, 5.0), None, (None, False)),
        (pose(1.0, 18.5), None, (None, None)),
    ],
)
def test_convergence_that_a_fault_forbids_to_the_end_is_open(
    events: list[RunEvent], within_s: float | None, expected: Row
) -> None:
    judge = judged(away(0.0, 99.0), events, within_s)
    assert found(rows(judge)[CONVERGE]) == expected


@pytest.mark.parametrize(
    ("events", "within_s", "expected"),
    [
        (pose(0.0), 7.0, (6.0, True)),
        (pose(0.0), None, (6.0, True)),
        (pose(0.0), 5.0, (6.0, None)),
        (pose(5.5), 5.0, (6.0, False)),  # the limit was over before the fault
        (pose(7.0), 7.0, (6.0, True)),
        (pose(7.0), 5.0, (6.0, False)),
        ([*pose(0.0, 3.0), *pose(7.0)], 5.0, (3.0, True)),  # it stood before the second fault
    ],
)
def test_a_team_that_converges_though_a_fault_forbids_it_has_its_true_time(
    events: list[RunEvent], within_s: float | None, expected: Row
) -> None:
    assert found(rows(judged(away(0.0, 6.0), events, within_s))[CONVERGE]) == expected


@pytest.mark.parametrize(("until_s", "held"), [(10.5, True), (14.0, None)])
def test_a_team_that_re_forms_though_a_fault_forbids_it_has_its_true_time(
    until_s: float, held: bool | None
) -> None:
    slow = SlowChanged(t_s=8.0, agent=0, planned=True, number=7, delay_s=0.5)
    ended = msgspec.structs.replace(slow, t_s=17.0, ends=True)
    judge = judged(away(8.0, until_s), [slow, kill(8.0), ended])
    lost = judge.recoveries[0]
    assert lost.reformed_s == pytest.approx(until_s - 8.0, abs=0.06)
    assert lost.timed_from_s is None
    assert rows(judge)["reform_within_s"].held is held


@pytest.mark.parametrize(("until_s", "expected"), [(12.0, (2.0, True)), (16.0, (6.0, False))])
def test_convergence_is_timed_from_the_end_of_a_fault_that_forbade_it(
    until_s: float, expected: Row
) -> None:
    judge = judged(away(0.0, until_s), pose(1.0, 10.0), 4.0)
    assert found(rows(judge)[CONVERGE]) == expected
    assert judge.phases[0].timed_from_s == 10.0
    assert judge.phases[0].converge_s == pytest.approx(until_s, abs=0.06)


def slow(from_s: float, to_s: float, delay_s: float) -> list[RunEvent]:
    fault = SlowChanged(t_s=from_s, agent=0, planned=True, number=7, delay_s=delay_s)
    return [fault, msgspec.structs.replace(fault, t_s=to_s, ends=True)]


@pytest.mark.parametrize(
    ("delay_s", "until_s", "expected"),
    [
        (3.0, 14.5, (1.5, True)),
        (3.0, 16.5, (3.5, True)),  # 6.5 s after the end of the fault
        (3.0, 17.5, (4.5, False)),
        (0.5, 14.0, (3.5, True)),
        (0.5, 15.0, (4.5, False)),
        (0.04, 15.0, (15.0, False)),  # a step of less than a tick forbids nothing
    ],
)
def test_convergence_is_timed_from_the_end_of_the_step_that_outlasts_a_slow_fault(
    delay_s: float, until_s: float, expected: Row
) -> None:
    judge = judged(away(0.0, until_s), slow(1.0, 10.0, delay_s), 4.0)
    assert found(rows(judge)[CONVERGE]) == expected


@pytest.mark.parametrize(("until_s", "held"), [(15.5, True), (17.5, False)])
def test_re_forming_is_timed_from_the_end_of_that_step_too(until_s: float, held: bool) -> None:
    judge = judged(away(8.0, until_s), [*slow(8.0, 11.0, 3.0), kill(12.0)])
    (ended, lost) = judge.recoveries
    assert (ended.kind, ended.t_s, lost.kind) == ("slow", 11.0, "kill")
    assert ended.overtaken_s == 0.0
    assert lost.timed_from_s == 14.0
    assert lost.reformed_s == pytest.approx(until_s - 14.0, abs=0.06)
    assert rows(judge)["reform_within_s"].held is held


def test_a_step_that_outlasts_its_fault_and_the_run_leaves_the_deadline_open() -> None:
    judge = judged(away(8.0, 99.0), slow(8.0, 16.5, 9.0))
    assert rows(judge)["reform_within_s"].held is None
    again = [*slow(8.0, 10.0, 4.0), slow(12.0, 13.0, 4.0)[0]]  # it begins again before it is over
    assert judged(away(8.0, 99.0), again).recoveries[0].timed_from_s is None


@pytest.mark.parametrize("at_s", [8.0, 10.0])
@pytest.mark.parametrize(("until_s", "held"), [(16.0, True), (18.5, False)])
def test_a_loss_inside_a_fault_that_forbids_re_forming_is_timed_from_its_end(
    at_s: float, until_s: float, held: bool
) -> None:
    judge = judged(away(8.0, until_s), [*pose(8.0, 15.0), kill(at_s)])
    row = rows(judge)["reform_within_s"]
    assert row.held is held
    lost = next(each for each in judge.recoveries if each.kind == "kill")
    assert lost.timed_from_s == 15.0
    if held:
        assert lost.reformed_s == pytest.approx(1.0, abs=0.06)


@pytest.mark.parametrize(("begins_s", "held"), [(9.0, None), (12.0, False)])
def test_a_loss_that_was_too_long_ago_before_such_a_fault_is_a_failure(
    begins_s: float, held: bool | None
) -> None:
    judge = judged(away(8.0, 99.0), [kill(8.0), *pose(begins_s)])
    assert rows(judge)["reform_within_s"].held is held


def test_a_new_disturbance_of_one_agent_needs_a_new_time_of_standing() -> None:
    small = PoseChanged(t_s=9.0, agent=1, planned=True, number=8, bias_m=(0.0, 0.0, 0.01))
    judge = judged(still, [kill(8.0), small])
    times_s = [(each.kind, each.reformed_s) for each in judge.recoveries]
    assert times_s == [("kill", pytest.approx(1.0)), ("pose", pytest.approx(0.0))]
    assert WINDOW_S > 1.0


@pytest.mark.parametrize(
    ("lost_s", "until_s", "held"),
    [
        ([8.0, 10.0], 10.5, True),  # within the limits of both
        ([8.0, 10.0], 12.0, None),  # 4 s after the first, 2 s after the second
        ([8.0, 10.0], 14.0, False),  # 4 s after the second, undisturbed
        ([8.0, 10.0, 12.0, 14.0, 16.0, 18.0], 99.0, None),  # nobody had 3 s
        ([8.0, 11.0, 13.0], 13.5, False),  # the first had all of its time
    ],
)
def test_a_loss_that_another_one_overtakes_is_open_and_the_last_one_is_judged(
    lost_s: list[float], until_s: float, held: bool | None
) -> None:
    judge = judged(away(7.0, until_s), [kill(t_s) for t_s in lost_s])
    assert rows(judge)["reform_within_s"].held is held


def test_a_start_that_was_refused_overtakes_nothing() -> None:
    refused = Restarted(t_s=9.0, agent=None, planned=True, refused="no room")
    assert rows(judged(away(7.0, 99.0), [kill(8.0), refused]))["reform_within_s"].held is False


@given(st.lists(st.floats(0.0, 100.0), min_size=1, max_size=8).map(sorted), st.booleans())
def test_the_time_asked_for_is_the_longest_without_a_fault(
    times_s: list[float], forbidden: bool
) -> None:
    asked, start_s, now = AskedTime(times_s[0], forbidden=forbidden), times_s[0], forbidden
    longest_s = 0.0
    for t_s in times_s[1:]:
        longest_s = max(longest_s, 0.0 if now else t_s - start_s)
        start_s, now = t_s, not now
        asked.note(t_s, forbidden=now)
        asked.note(t_s, forbidden=now)
    end_s = times_s[-1] + 1.0
    assert asked.until(end_s) == max(longest_s, 0.0 if now else end_s - start_s)
