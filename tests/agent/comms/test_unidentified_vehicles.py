"""Unidentified vehicles: how they are found and remembered, and which are known members."""

import pytest

from agent.comms.unidentified_vehicles import (
    MAX_REMEMBERED,
    RECENT_S,
    UNIDENTIFIED_AFTER_S,
    DepartedMember,
    MemberPosition,
    Surroundings,
    UnidentifiedVehicles,
)
from tests.agent.comms.builders import ORIGIN, beacon

VEHICLE = (1.0, 0.0, 0.0)
FAR_MEMBER = MemberPosition(id=5, position=(-2.0, 0.0, 0.0), age_s=0.0)
BEACONS = [beacon(5, 1, 10.0, at=FAR_MEMBER.position)]


def surroundings(now_s, sensed=(VEHICLE,), team=(FAR_MEMBER,), here=ORIGIN, **fields):
    return Surroundings(
        now_s=now_s, position=here, sensed=sensed, team=team, **{"beacons": BEACONS, **fields}
    )


def updated(known, now_s, **fields):
    return known.update(surroundings(now_s, **fields))


def test_a_vehicle_without_a_beacon_is_unidentified_after_a_while():
    known = UnidentifiedVehicles(0.5)
    assert updated(known, 10.0) == ()
    assert updated(known, 10.0 + UNIDENTIFIED_AFTER_S - 0.1) == ()
    assert updated(known, 10.0 + UNIDENTIFIED_AFTER_S) == (VEHICLE,)


def test_the_vehicle_of_a_departed_member_is_unidentified_at_once():
    known = UnidentifiedVehicles(0.5)
    assert updated(known, 10.0, team=(FAR_MEMBER, MemberPosition(6, VEHICLE, 1.4))) == ()
    assert updated(known, 10.2, departed=[DepartedMember(VEHICLE, 8.6)]) == (VEHICLE,)


def test_a_member_that_departed_elsewhere_does_not_count():
    known = UnidentifiedVehicles(0.5)
    assert updated(known, 10.0, departed=[DepartedMember((1.0, 0.5, 0.0), 8.0)]) == ()


def test_a_member_may_be_anywhere_within_the_distance_flown_since_its_report():
    known = UnidentifiedVehicles(0.5)
    old = MemberPosition(6, (2.0, 0.0, 0.0), 1.5)
    for now_s in (10.0, 12.0, 14.0):
        assert updated(known, now_s, team=(FAR_MEMBER, old)) == ()


def test_a_vehicle_beyond_all_neighbours_may_be_out_of_the_radios_range():
    known = UnidentifiedVehicles(0.5)
    for now_s in (10.0, 12.0, 14.0):
        beacons = [beacon(5, 1, 10.0, at=(0.5, 0.0, 0.0))]
        assert updated(known, now_s, beacons=beacons) == ()


@pytest.mark.parametrize(
    ("away", "remembered"), [((3.0, 0.0, 0.0), True), ((0.5, 0.0, 0.0), False)]
)
def test_a_vehicle_is_remembered_out_of_sight_but_not_where_it_would_be_sensed(away, remembered):
    known = UnidentifiedVehicles(0.5)
    for now_s in (10.0, 12.0):
        updated(known, now_s)
    for now_s in (12.2, 100.0, 1000.0):
        found = updated(known, now_s, sensed=(), here=away)
        assert found == ((VEHICLE,) if remembered else ())


def test_the_last_survivor_takes_the_dead_vehicle_for_unidentified():
    known = UnidentifiedVehicles(0.5)
    alive = MemberPosition(6, VEHICLE, 0.0)
    assert updated(known, 10.0, team=(alive,), beacons=[beacon(6, 1, 10.0, at=VEHICLE)]) == ()
    gone = [DepartedMember(VEHICLE, 10.0)]
    assert updated(known, 11.6, team=(), beacons=[], departed=gone) == (VEHICLE,)
    assert updated(known, 11.6 + 2 * RECENT_S, team=(), beacons=[]) == (VEHICLE,)


def test_a_vehicle_farther_than_any_member_was_heard_from_is_not_judged():
    known = UnidentifiedVehicles(0.5)
    near = [beacon(5, 1, 10.0, at=(0.5, 0.0, 0.0))]
    for now_s, beacons in ((10.0, near), (12.0, []), (14.0, near)):
        assert updated(known, now_s, team=(), beacons=beacons) == ()


@pytest.mark.parametrize(
    ("new_id", "at", "forgotten"), [(5, 2.0, False), (9, 2.0, True), (9, 5.0, False)]
)
def test_a_remembered_vehicle_is_forgotten_when_it_may_have_become_a_member(new_id, at, forgotten):
    known = UnidentifiedVehicles(0.5)
    for now_s in (10.0, 12.0):
        updated(known, now_s)
    away = (3.0, 0.0, 0.0)
    newcomer = MemberPosition(new_id, (1.0, at, 0.0), 0.0)
    found = updated(known, 16.0, sensed=(), here=away, team=(newcomer,))
    assert found == (() if forgotten else (VEHICLE,)), "4 s at 0.5 m/s are 2 m"


def test_a_vehicle_remembered_for_long_is_not_taken_for_another_one():
    known = UnidentifiedVehicles(0.5)
    for now_s in (10.0, 12.0):
        updated(known, now_s)
    at, now_s = (4.0, 0.0, 0.0), 12.0 + 2 * RECENT_S
    gone = [DepartedMember(at, now_s - UNIDENTIFIED_AFTER_S)]
    found = updated(known, now_s, here=(3.5, 0.0, 0.0), sensed=[(0.5, 0.0, 0.0)], departed=gone)
    assert sorted(found) == [VEHICLE, at]


def test_the_memory_is_bounded():
    known = UnidentifiedVehicles(0.5)
    for stop in range(2 * MAX_REMEMBERED):
        for now_s in (10.0 * stop, 10.0 * stop + 2.0):
            x = 5.0 * stop
            updated(known, now_s, sensed=[(1.0, 0.0, 0.0)], here=(x, 0.0, 0.0))
    assert len(updated(known, 10_000.0, sensed=(), here=(-9.0, 0.0, 0.0))) <= MAX_REMEMBERED + 1


def test_a_vehicle_that_flies_past_is_not_remembered():
    known = UnidentifiedVehicles(0.5)
    gone = [DepartedMember((1.0, 0.0, 0.0), 8.0)]
    assert updated(known, 10.0, departed=gone) == (VEHICLE,)
    for step in range(1, 12):
        found = updated(known, 10.0 + 0.2 * step, sensed=[(1.0, 0.1 * step, 0.0)])
        assert found in ((VEHICLE,), ())
    assert updated(known, 12.4, sensed=(), here=(-1.0, 0.0, 0.0)) == ()


@pytest.mark.parametrize("reports", [True, False])
def test_a_neighbour_that_would_see_a_remembered_vehicle_and_reports_none_is_believed(reports):
    known = UnidentifiedVehicles(0.5)
    for now_s in (10.0, 12.0):
        updated(known, now_s)
    witness = beacon(5, 1, 12.2, at=(1.0, 1.0, 0.0))
    remembered = updated(
        known,
        12.2,
        here=(3.0, 0.0, 0.0),
        sensed=(),
        beacons=[witness],
        reports_vehicle=lambda *_: reports,
    )
    assert remembered == ((VEHICLE,) if reports else ())
