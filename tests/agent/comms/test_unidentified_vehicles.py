"""Unidentified vehicles: how they are found and remembered, and which are known members."""

import pytest

from agent.comms.unidentified_vehicles import (
    MEMORY_S,
    UNIDENTIFIED_AFTER_S,
    DepartedMember,
    MemberPosition,
    Surroundings,
    UnidentifiedVehicles,
)
from tests.agent.comms.builders import ORIGIN, beacon

VEHICLE = (1.0, 0.0, 0.0)
FAR_MEMBER = MemberPosition(position=(-2.0, 0.0, 0.0), age_s=0.0)
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
    assert updated(known, 10.0, team=(FAR_MEMBER, MemberPosition(VEHICLE, 1.4))) == ()
    assert updated(known, 10.2, departed=[DepartedMember(VEHICLE, 8.6)]) == (VEHICLE,)


def test_a_member_that_departed_elsewhere_does_not_count():
    known = UnidentifiedVehicles(0.5)
    assert updated(known, 10.0, departed=[DepartedMember((1.0, 0.5, 0.0), 8.0)]) == ()


def test_a_member_may_be_anywhere_within_the_distance_flown_since_its_report():
    known = UnidentifiedVehicles(0.5)
    old = MemberPosition((2.0, 0.0, 0.0), 1.5)
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
    assert updated(known, 12.2, sensed=(), here=away) == ((VEHICLE,) if remembered else ())
    assert updated(known, 12.4 + MEMORY_S, sensed=(), here=away) == ()


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
