"""Unidentified vehicles: how they are found and remembered, and which are known members."""

from itertools import pairwise
from math import dist

import pytest

from agent.comms.unidentified_vehicles import (
    MAX_REMEMBERED,
    MISSED_S,
    RECENT_S,
    REMEMBERED_S,
    UNIDENTIFIED_AFTER_S,
    UNMOVED_RANGE_M,
    DepartedMember,
    MemberPosition,
    Surroundings,
    UnidentifiedVehicles,
)
from agent.messages import PROXIMITY_RANGE_M
from tests.agent.comms.builders import ORIGIN, heard_beacon

VEHICLE = (1.0, 0.0, 0.0)
FAR_MEMBER = MemberPosition(id=5, position=(-2.0, 0.0, 0.0), age_s=0.0)
BEACONS = [heard_beacon(5, 1, 10.0, at=FAR_MEMBER.position)]


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
        beacons = [heard_beacon(5, 1, 10.0, at=(0.5, 0.0, 0.0))]
        assert updated(known, now_s, beacons=beacons) == ()


@pytest.mark.parametrize(
    ("away", "remembered"), [((3.0, 0.0, 0.0), True), ((0.5, 0.0, 0.0), False)]
)
def test_a_vehicle_is_remembered_out_of_sight_but_not_where_it_would_be_sensed(away, remembered):
    known = UnidentifiedVehicles(0.5)
    for now_s in (10.0, 12.0):
        updated(known, now_s)
    for now_s in (12.2, 30.0, 11.9 + REMEMBERED_S):
        found = updated(known, now_s, sensed=(), here=away)
        assert found == ((VEHICLE,) if remembered else ())


def test_the_last_survivor_takes_the_dead_vehicle_for_unidentified():
    known = UnidentifiedVehicles(0.5)
    alive = MemberPosition(6, VEHICLE, 0.0)
    assert updated(known, 10.0, team=(alive,), beacons=[heard_beacon(6, 1, 10.0, at=VEHICLE)]) == ()
    gone = [DepartedMember(VEHICLE, 10.0)]
    assert updated(known, 11.6, team=(), beacons=[], departed=gone) == (VEHICLE,)
    assert updated(known, 11.6 + 2 * RECENT_S, team=(), beacons=[]) == (VEHICLE,)


def test_a_vehicle_farther_than_any_member_was_heard_from_is_not_judged():
    known = UnidentifiedVehicles(0.5)
    near = [heard_beacon(5, 1, 10.0, at=(0.5, 0.0, 0.0))]
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


STEP_S = 0.2
AWAY = (4.0, 0.0, 0.0)


def identified():
    """Return an agent's unidentified vehicles after it has sensed one from 10 s to 12 s."""
    known = UnidentifiedVehicles(0.5)
    for now_s in (10.0, 12.0):
        updated(known, now_s)
    return known


def forgotten_after_s(known, from_s, **fields):
    """Return how long the agent remembers vehicles that it no longer senses; at most 9999 s."""
    for step in range(1, round(9999.0 / STEP_S)):
        if not updated(known, from_s + step * STEP_S, sensed=(), **fields):
            return step * STEP_S
    return 9999.0


def seen_from(known, from_s, seconds, here=ORIGIN, vehicles=(VEHICLE,)):
    """Let the agent sense vehicles for so long; return what it knows, and the time then."""
    found, now_s = (), from_s
    while now_s < from_s + seconds:
        now_s += STEP_S
        x, y, z = here
        sensed = [(u - x, v - y, w - z) for u, v, w in vehicles]
        found = updated(known, now_s, sensed=sensed, here=here)
    return found, now_s


def test_the_memory_of_a_vehicle_that_left_out_of_sight_ends():
    assert forgotten_after_s(identified(), 12.0, here=AWAY) == pytest.approx(REMEMBERED_S)


@pytest.mark.parametrize("away_m", [1.85, UNMOVED_RANGE_M - 0.01])
def test_a_vehicle_that_leaves_at_the_edge_of_the_sensors_range_is_missed_soon(away_m):
    known, here = UnidentifiedVehicles(0.5), (1.0 + away_m, 0.0, 0.0)
    found, now_s = seen_from(known, 10.0, 2.0, here)
    assert found == (VEHICLE,)
    assert forgotten_after_s(known, now_s, here=here) <= MISSED_S + 2 * STEP_S


def test_a_vehicle_that_may_have_drifted_out_of_range_is_not_missed():
    known, here = UnidentifiedVehicles(0.5), (1.0 + UNMOVED_RANGE_M - 0.02, 0.0, 0.0)
    _, now_s = seen_from(known, 10.0, 2.0, here)
    _, now_s = seen_from(known, now_s, STEP_S, here, [(0.97, 0.0, 0.0)])
    assert forgotten_after_s(known, now_s, here=here) > 10.0 * MISSED_S


def test_a_vehicle_that_flickers_at_the_edge_of_range_stays_known():
    known, here = UnidentifiedVehicles(0.5), (1.0 + UNMOVED_RANGE_M - 0.01, 0.0, 0.0)
    found, now_s = seen_from(known, 10.0, 2.0, here)
    for _ in range(50):
        _, now_s = seen_from(known, now_s, STEP_S, here, ())
        found, now_s = seen_from(known, now_s, STEP_S, here)
        assert found == (VEHICLE,)


def test_only_the_one_of_two_vehicles_that_leaves_is_forgotten():
    known, here, stays = UnidentifiedVehicles(0.5), (2.9, 0.0, 0.0), (2.0, 1.0, 0.0)
    found, now_s = seen_from(known, 10.0, 2.0, here, [VEHICLE, stays])
    assert sorted(found) == [VEHICLE, stays]
    found, _ = seen_from(known, now_s, 2.0 * MISSED_S, here, [stays])
    assert found == (stays,)


@pytest.mark.parametrize("away", [AWAY, (1.0 + UNMOVED_RANGE_M - 0.01, 0.0, 0.0)])
def test_a_vehicle_that_returns_and_leaves_again_is_forgotten_again(away):
    known, now_s, lasted_s = UnidentifiedVehicles(0.5), 10.0, []
    for _ in range(4):
        found, now_s = seen_from(known, now_s, 2.0)
        assert found == (VEHICLE,)
        lasted_s.append(forgotten_after_s(known, now_s, here=away))
        now_s += lasted_s[-1] + 1.0
    for before_s, after_s in pairwise(lasted_s):
        assert after_s == pytest.approx(2.0 * before_s, abs=3.0 * STEP_S)


def test_a_vehicle_that_passes_where_one_was_given_up_is_not_known():
    known, here = UnidentifiedVehicles(0.5), (2.9, 0.0, 0.0)
    _, now_s = seen_from(known, 10.0, 2.0, here)
    now_s += forgotten_after_s(known, now_s, here=here)
    for vehicles in ([VEHICLE], [(1.0, 0.3, 0.0)], []):
        found, now_s = seen_from(known, now_s, STEP_S, here, vehicles)
        assert found == ()


def test_agents_look_after_a_dead_vehicle_ever_less_often():
    """The agent flies to the place once it forgets the vehicle, and away once it knows of it."""
    known, looks, hours_s = identified(), 0, 3600.0
    at, now_s = AWAY, 12.0
    while now_s < hours_s:
        now_s += STEP_S
        away_m = dist(at, VEHICLE)
        sensed = [tuple(v - x for v, x in zip(VEHICLE, at, strict=True))]
        found = updated(known, now_s, sensed=sensed if away_m < 2.0 else (), here=at)
        looks += at == AWAY and not found
        x = at[0] + STEP_S * 0.5 * (1.0 if found else -1.0)
        at = (min(AWAY[0], x), 0.0, 0.0)
    assert 2 <= looks <= 6, "six memories, of 60 s and each twice as long, last over 3600 s"


def test_an_agent_that_wrongly_misses_a_dead_vehicle_does_so_ever_less_often():
    """The vehicle trembles: the agent senses it for a while, and misses it for long."""
    known, lost, now_s = UnidentifiedVehicles(0.5), 0, 10.0
    here = (1.0 + UNMOVED_RANGE_M - 0.01, 0.0, 0.0)
    for _ in range(100):
        found, now_s = seen_from(known, now_s, 4.0, here)
        assert found == (VEHICLE,)
        found, now_s = seen_from(known, now_s, 20.0, here, ())
        lost += not found
    assert lost <= 4, "a memory of 1.5 s, doubled four times, lasts over 20 s"


@pytest.mark.parametrize("away_m", [1.0, UNMOVED_RANGE_M - 0.01])
@pytest.mark.parametrize("reports", [True, False])
def test_a_neighbour_that_would_sense_a_remembered_vehicle_and_reports_none_is_believed(
    reports, away_m
):
    forgotten_s = forgotten_after_s(
        identified(),
        12.0,
        here=AWAY,
        beacons=[heard_beacon(5, 1, 12.2, at=(1.0, away_m, 0.0))],
        reports_vehicle=lambda *_: reports,
    )
    assert forgotten_s == pytest.approx(REMEMBERED_S if reports else MISSED_S, abs=2 * STEP_S)


def test_a_neighbour_out_of_the_sensors_range_contradicts_nothing():
    witness = heard_beacon(5, 1, 12.2, at=(1.0, PROXIMITY_RANGE_M, 0.0))
    forgotten_s = forgotten_after_s(
        identified(), 12.0, here=AWAY, beacons=[witness], reports_vehicle=lambda *_: False
    )
    assert forgotten_s == pytest.approx(REMEMBERED_S)
