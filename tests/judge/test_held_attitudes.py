"""``expect.attitude_within_deg``: at the end, and once an agent has settled in its slot."""

from dataclasses import replace
from math import radians

import msgspec
import numpy as np
import pytest

from agent.qstructure.orientation import OrientationSpec
from tests.recording.flights import straight_flight, wedge
from worldsim.judge.run_events import PoseChanged
from worldsim.judge.verdict import Judge
from worldsim.scenario.tables import Expectations

AGENTS, YAW_DEG, WITHIN_DEG = 5, 30.0, 10.0
LEVEL = wedge(AGENTS, duration_s=12.0)
TURNED = msgspec.structs.replace(
    LEVEL,
    formation=msgspec.structs.replace(
        LEVEL.formation,
        queue=tuple(
            msgspec.structs.replace(queue, orientation=OrientationSpec(yaw_deg=YAW_DEG))
            for queue in LEVEL.formation.queue
        ),
    ),
)


def expectation(yaw_deg_at, scenario=TURNED, change=lambda tick: tick, events=()):
    """Return what a run shows whose first agent has these yaws over the time [s], and its judge."""
    expect = Expectations(min_separation_m=0.0, attitude_within_deg=WITHIN_DEG)
    judge, waiting = Judge(msgspec.structs.replace(scenario, expect=expect)), list(events)
    for tick in straight_flight(scenario):
        while waiting and waiting[0].t_s <= tick.time_s:
            judge.handle_event(waiting.pop(0))
        attitude = np.zeros_like(tick.attitude)
        attitude[:, 0] = radians(YAW_DEG)
        attitude[0, 0] = radians(yaw_deg_at(tick.time_s))
        judge.see(change(replace(tick, attitude=attitude)))
    (row,) = [each for each in judge.expectations() if each.name == "attitude_within_deg"]
    return row, judge


@pytest.mark.parametrize(("off_deg", "held"), [(0.0, True), (-9.9, True), (10.1, False)])
def test_an_agent_that_stands_otherwise_than_its_queue_fails(off_deg, held):
    row, _ = expectation(lambda time_s: YAW_DEG + off_deg)
    assert (row.wanted, row.held) == (WITHIN_DEG, held)
    assert row.got == pytest.approx(abs(off_deg), abs=1e-3)


def wrong_yaw(from_s, to_s=None, agent=0, bias_yaw_deg=30.0):
    """Return the events of a fault of an agent's pose."""
    fault = PoseChanged(t_s=from_s, agent=agent, planned=True, number=3, bias_yaw_deg=bias_yaw_deg)
    ends = [] if to_s is None else [msgspec.structs.replace(fault, t_s=to_s, ends=True)]
    return [fault, *ends]


@pytest.mark.parametrize(
    ("events", "held"),
    [
        ([], False),
        (wrong_yaw(8.0), True),
        (wrong_yaw(8.0, agent=1), False),
        (wrong_yaw(8.0, bias_yaw_deg=0.0), False),
        (wrong_yaw(8.0, 9.5), True),  # it has 3 s to turn back
        (wrong_yaw(5.0, 8.0), False),
    ],
)
def test_an_agent_does_not_answer_for_its_yaw_while_it_measures_it_wrong(events, held):
    row, _ = expectation(lambda time_s: YAW_DEG + 30.0 * (8.0 < time_s < 11.6), events=events)
    assert row.held is held


def test_a_yaw_that_is_wrong_all_the_time_is_not_judged():
    events = [each for agent in range(AGENTS) for each in wrong_yaw(0.0, agent=agent)]
    row, _ = expectation(lambda time_s: 0.0, events=events)
    assert (row.got, row.held) == (None, None)


def test_the_way_to_the_slot_and_the_first_turn_there_do_not_count():
    _, judge = expectation(lambda time_s: YAW_DEG)
    settles_s = judge.phases[0].converge_s + 3.0  # 2 s in place, and half a turn
    row, _ = expectation(lambda time_s: YAW_DEG + 90.0 * (time_s < settles_s - 0.1))
    assert row.held


def test_an_agent_that_turns_away_later_fails_though_it_turns_back():
    row, _ = expectation(lambda time_s: YAW_DEG + 90.0 * (10.0 < time_s < 10.2))
    assert not row.held
    assert row.got == pytest.approx(90.0, abs=1e-3)


def test_an_agent_that_has_not_come_to_rest_counts_at_the_end():
    row, _ = expectation(lambda time_s: YAW_DEG + 90.0 * (time_s > 11.99))
    assert not row.held


def test_one_that_takes_no_part_does_not_count():
    def killed(tick):
        alive = tick.alive.copy()
        alive[0] = False
        return replace(tick, alive=alive)

    row, _ = expectation(lambda time_s: YAW_DEG + 90.0, change=killed)
    assert row.held


def test_without_a_slot_to_be_measured_at_it_is_not_held():
    def unplaced(tick):
        return replace(tick, place=np.full_like(tick.place, -1))

    row, _ = expectation(lambda time_s: YAW_DEG, change=unplaced)
    assert (row.got, row.held) == (None, False)


def test_a_formation_that_leaves_every_angle_free_tests_nothing():
    row, _ = expectation(lambda time_s: YAW_DEG + 90.0, scenario=LEVEL)
    assert (row.got, row.held) == (None, True)
