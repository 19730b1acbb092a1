"""Whereabouts: no vehicle that was heard once is forgotten, and none is invented."""

from math import inf

from agent.comms.whereabouts import PROMISE_S, VehicleReport, Whereabouts
from agent.messages import Record
from tests.agent.comms.builders import ORIGIN, heard_beacon


def record(subject, stamp_s, at):
    return Record(
        id=subject,
        incarnation=0,
        version=1,
        stamp_s=stamp_s,
        position=at,
        queue=-1,
        rank=-1,
        cost_mm=0,
        mission=0,
        blocked=(),
    )


def test_a_silent_vehicle_is_never_forgotten():
    known = Whereabouts(0, 2)
    known.hear(heard_beacon(1, 1, 2.0, at=(1.0, 0.0, 0.0), speed_cap=0.3))
    assert known.reports((0.5, 0.0, 0.0), 1000.0) == [VehicleReport((0.5, 0.0, 0.0), 998.0, 0.3)]


def test_members_that_never_reported_leave_it_incomplete():
    known = Whereabouts(0, 3)
    assert not known.complete
    known.hear(heard_beacon(1, 1, 0.0))
    assert not known.complete
    known.relay([record(2, 0.0, ORIGIN)])
    assert known.complete


def test_a_single_vehicle_waits_for_no_other():
    assert Whereabouts(0, 1).complete
    assert Whereabouts(5, 0).complete


def test_a_relayed_record_counts_once_the_promise_has_run_out():
    known = Whereabouts(0, 2)
    known.hear(heard_beacon(1, 1, 2.0, at=(1.0, 0.0, 0.0), speed_cap=0.3))
    known.relay([record(1, 4.0, (9.0, 0.0, 0.0))])
    within, after = 2.0 + PROMISE_S, 2.1 + PROMISE_S
    assert known.reports(ORIGIN, within) == [VehicleReport((1.0, 0.0, 0.0), PROMISE_S, 0.3)]
    assert known.reports(ORIGIN, after) == [VehicleReport((9.0, 0.0, 0.0), after - 4.0, inf)]


def test_a_relayed_subject_that_nobody_briefed_or_heard_is_ignored():
    known = Whereabouts(0, 2)
    known.relay([record(subject, 0.0, ORIGIN) for subject in (7, 8, 9)])
    assert known.reports(ORIGIN, 1.0) == []
