"""Sensor health: stuck readings, missing or jumping scans, and neighbours not sensed."""

from array import array
from random import Random

import pytest

from agent.config import Sensors
from agent.messages import NO_ECHO_MM, Observation, Scan
from agent.sensing.ray_pattern import pattern_of
from agent.sensing.scan_jumps import EMPTY_S, READINGS, VehicleJumps
from agent.sensing.sensor_health import LOOKS, PROXIMITY, SensorHealth
from tests.agent.comms.builders import heard_beacon

LASER = pattern_of("laser", Sensors(coverage="planar"), 20.0)


def scan_of(ranges):
    return Scan(kind=0, ranges=array("H", ranges).tobytes())


ECHO = scan_of([1000] * 61)
NONE = scan_of([NO_ECHO_MM] * 61)


def observation(tick, x=0.0, vehicles=(), scans=(), obstacles=()):
    return Observation(
        slot=4 * tick,
        time_s=0.05 * tick,
        position=(x, 0.0, 0.0),
        velocity=(0.0,) * 3,
        yaw=0.0,
        vehicles=vehicles,
        obstacles=obstacles,
        orders=(),
        scans=scans,
    )


def sensor_health(patterns=(), ranging=True, noisy=(PROXIMITY, 0)):
    jumps = VehicleJumps(0.5, 0.0) if ranging else None
    return SensorHealth(patterns, jumps, frozenset(noisy), 20.0, 0.5)


def test_an_unchanged_reading_of_a_moving_vehicle_is_distrusted_until_it_changes():
    watch, vehicle = sensor_health(), ((1.0, 0.0, 0.0),)
    trusted = [watch.update(observation(tick, 0.01 * tick, vehicle)) for tick in range(8)]
    assert trusted == [True] * 4 + [False] * 4
    assert watch.update(observation(9, 0.1, ((0.9, 0.0, 0.0),)))


def test_a_standing_vehicle_or_one_that_senses_nothing_may_read_the_same_for_ever():
    watch = sensor_health()
    assert all(watch.update(observation(tick, 0.0, ((1.0, 0.0, 0.0),))) for tick in range(50))
    assert all(sensor_health().update(observation(tick, 0.1 * tick)) for tick in range(50))
    scanning = sensor_health((LASER,))
    assert all(scanning.update(observation(tick, 0.1 * tick, scans=(NONE,))) for tick in range(50))


def test_without_noise_vehicles_side_by_side_read_the_same():
    watch = sensor_health(noisy=())
    assert all(
        watch.update(observation(tick, 0.1 * tick, ((1.0, 0.0, 0.0),))) for tick in range(50)
    )


def test_without_noise_a_reading_may_stay_along_a_wall_but_not_on_approach():
    along, towards = sensor_health(noisy=()), sensor_health(noisy=())
    beside, ahead = ((0.0, 1.25, 0.0),), ((1.25, 0.0, 0.0),)
    assert all(along.update(observation(tick, 0.1 * tick, obstacles=beside)) for tick in range(50))
    assert not all(
        towards.update(observation(tick, 0.01 * tick, obstacles=ahead)) for tick in range(8)
    )


def anywhere(random, count):
    return tuple(tuple(random.uniform(-1.1, 1.1) for _ in range(3)) for _ in range(count))


@pytest.mark.parametrize("count", [1, 3, 8])
def test_vehicles_that_leap_are_distrusted_without_any_report(count):
    watch, random = sensor_health(), Random(count)
    trusted = [watch.update(observation(tick, 0.0, anywhere(random, count))) for tick in range(60)]
    assert not all(trusted[: 3 * READINGS])
    assert sum(trusted) < 20


@pytest.mark.parametrize("noise", [0.0, 0.05])
def test_vehicles_that_fly_as_fast_as_they_can_do_not_leap(noise):
    random, watch = Random(3), VehicleJumps(0.5, noise)
    at = [list(each) for each in anywhere(random, 5)]
    for tick in range(400):
        for each in at:
            for axis in range(3):
                each[axis] += random.choice((-1, 1)) * 0.05 / 3**0.5
        read = [tuple(x + random.gauss(0.0, noise) for x in each) for each in at]
        watch.add(0.05 * tick, [each for each in read if sum(x * x for x in each) < 4.0])
        assert not watch.wrong


def test_vehicles_that_appear_and_vanish_are_trusted():
    watch = sensor_health()
    for tick in range(80):
        there = ((1.0, 0.001 * tick, 0.0),) if tick // 10 % 2 else ()
        assert watch.update(observation(tick, 0.0, there))


def leaping(watch, ticks, reports=()):
    """Let the sensor of a standing vehicle jump, beside neighbours that report themselves."""
    random = Random(7)
    for tick in range(ticks):
        seen = observation(tick, 0.0, anywhere(random, 2))
        watch.update(seen)
        watch.compare(
            seen, [heard_beacon(k, tick, 0.05 * tick, at=at) for k, at in enumerate(reports)]
        )
    assert not watch.update(observation(ticks, 0.0, anywhere(random, 2)))


@pytest.mark.parametrize("edge", [(), ((1.97, 0.0, 0.0),)])
@pytest.mark.parametrize("reports", [(), ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0))])
def test_a_sensor_that_has_jumped_is_trusted_after_a_time_with_nobody_within_its_range(
    edge, reports
):
    """Also where it has missed neighbours meanwhile: all have left, and nobody comes near."""
    watch, waits = sensor_health(), round(20.0 * EMPTY_S)
    leaping(watch, 20, reports)
    trusted = []
    for tick in range(21, 21 + waits + 2):
        now = observation(tick, 0.0, edge)
        trusted.append(watch.update(now))
        watch.compare(now, [heard_beacon(9, tick, 0.05 * tick, at=(5.0, 0.0, 0.0))])
    assert trusted == [False] * waits + [True] * 2


def test_a_sensor_that_has_jumped_and_reads_nobody_beside_a_neighbour_stays_distrusted():
    watch = sensor_health()
    leaping(watch, 20)
    for tick in range(21, 121):
        now = observation(tick)
        assert not watch.update(now)
        watch.compare(now, [heard_beacon(1, tick, 0.05 * tick, at=(1.6, 0.0, 0.0))])


def test_a_sensor_that_still_jumps_is_distrusted_as_soon_as_somebody_comes_near():
    watch, random = sensor_health(), Random(3)
    leaping(watch, 20)
    assert [watch.update(observation(tick)) for tick in (21, 21 + round(20.0 * EMPTY_S))][1]
    jumping = [watch.update(observation(70 + k, 0.0, anywhere(random, 1))) for k in range(3)]
    assert jumping == [True, True, False]


def test_a_blind_sensor_that_never_jumped_is_not_trusted_for_reading_nothing():
    """A silent sensor reads nothing either."""
    watch = sensor_health()
    for look in range(LOOKS):
        watch.compare(observation(0), [heard_beacon(1, look, 0.01 * look, at=(1.0, 0.0, 0.0))])
    for tick in range(200):
        assert not watch.update(observation(tick))
        watch.compare(observation(tick), [heard_beacon(2, tick, 0.05 * tick, at=(5.0, 0.0, 0.0))])


def test_a_scanner_that_has_jumped_is_trusted_after_a_time_without_echoes():
    watch, random = sensor_health((LASER,), ranging=False), Random(5)
    for k in range(8):
        wild = scan_of([random.randrange(NO_ECHO_MM) for _ in range(61)])
        trusted = watch.update(observation(2 * k, 0.1 * k, scans=(wild,)))
    assert not trusted
    ticks = range(16, 60, 2)
    after = [watch.update(observation(tick, 0.8, scans=(NONE,))) for tick in ticks]
    waits = round(10.0 * EMPTY_S)
    assert after == [False] * waits + [True] * (len(ticks) - waits)


def test_missing_scans_are_noticed():
    watch = sensor_health((LASER,), ranging=False)
    assert watch.update(observation(0, scans=(ECHO,)))
    assert [watch.update(observation(tick)) for tick in (2, 6, 7, 20)] == [True, True, False, False]
    assert watch.update(observation(21, 0.5, scans=(NONE,)))


@pytest.mark.parametrize(("vehicles", "trusted"), [((), False), (((1.0, 0.1, 0.0),), True)])
def test_a_neighbour_near_by_must_be_sensed(vehicles, trusted):
    watch = sensor_health()
    for look in range(LOOKS):
        there = heard_beacon(1, look, stamp_s=0.01 * look, at=(1.0, 0.0, 0.0))
        watch.compare(observation(0, vehicles=vehicles), [there])
    assert watch.update(observation(0, vehicles=vehicles)) is trusted


def test_old_beacons_and_far_neighbours_prove_nothing():
    watch = sensor_health()
    old, far = (
        heard_beacon(1, 1, stamp_s=0.0, at=(1.0, 0.0, 0.0)),
        heard_beacon(2, 1, stamp_s=2.0, at=(1.5, 0.0, 0.0)),
    )
    for _ in range(2 * LOOKS):
        watch.compare(observation(40), [old, far])
    assert watch.update(observation(40))


def test_a_blind_sensor_is_trusted_again_once_it_senses_a_neighbour():
    watch, vehicle = sensor_health(), ((1.0, 0.0, 0.0),)
    there = heard_beacon(1, 1, stamp_s=0.0, at=(1.0, 0.0, 0.0))
    gone = heard_beacon(1, 1, stamp_s=10.0, at=(5.0, 0.0, 0.0))
    for look in range(LOOKS):
        speaking = heard_beacon(1, look, stamp_s=0.01 * look, at=(1.0, 0.0, 0.0))
        watch.compare(observation(0), [speaking])
    for _ in range(2 * LOOKS):
        watch.compare(observation(0), [gone])
        assert not watch.update(observation(0))
    for _ in range(LOOKS):
        assert not watch.update(observation(0))
        watch.compare(observation(0, vehicles=vehicle), [there])
    assert watch.update(observation(0, vehicles=vehicle))


def test_a_blind_sensor_is_trusted_again_once_it_senses_a_neighbour_farther_away():
    """The team has formed elsewhere; nobody comes near an agent that stands still."""
    watch, away = sensor_health(), (1.9, 0.0, 0.0)
    for look in range(LOOKS):
        speaking = heard_beacon(1, look, stamp_s=0.01 * look, at=(1.0, 0.0, 0.0))
        watch.compare(observation(0), [speaking])
    assert not watch.update(observation(0))
    there = heard_beacon(1, 9, stamp_s=0.0, at=away)
    for _ in range(LOOKS):
        watch.compare(observation(0, vehicles=(away,)), [there])
    assert watch.update(observation(0, vehicles=(away,)))


def test_jumping_scans_are_wrong_and_quiet_ones_are_right_again():
    watch, random = sensor_health((LASER,), ranging=False), Random(5)
    ranges = [random.randrange(1 << 16) for _ in range(61 * 8)]
    wild = [scan_of(ranges[k : k + 61]) for k in range(0, len(ranges), 61)]
    trusted = [
        watch.update(observation(2 * k, 0.1 * k, scans=(scan,))) for k, scan in enumerate(wild)
    ]
    assert trusted == [True] * 3 + [False] * 5
    calm = [scan_of([1000 + 10 * k] * 61) for k in range(5)]
    trusted = [
        watch.update(observation(16 + 2 * k, 0.8, scans=(scan,))) for k, scan in enumerate(calm)
    ]
    assert trusted == [False] * 3 + [True] * 2


def test_a_departed_neighbour_is_missed_once_and_proves_no_blind_sensor():
    watch = sensor_health()
    gone = heard_beacon(1, 7, 1.0, at=(1.0, 0.0, 0.0))
    for tick in range(20, 40, 2):
        watch.compare(observation(tick), [gone])
        assert watch.update(observation(tick))


@pytest.mark.parametrize(("others", "trusted"), [((), True), ((2,), False)])
def test_a_neighbour_that_misreported_itself_proves_no_blind_sensor(others, trusted):
    """Its report jumps back to where it is: nobody was there where it was missed."""
    watch = sensor_health()
    accusers = (1, *others)
    for look in range(LOOKS):
        there = [heard_beacon(k, look, stamp_s=0.01 * look, at=(1.0, 0.0, 0.0)) for k in accusers]
        watch.compare(observation(0), there)
    assert not watch.update(observation(0))
    back = heard_beacon(1, LOOKS, stamp_s=0.01 * LOOKS, at=(4.0, 0.0, 0.0))
    watch.compare(observation(0), [back])
    assert watch.update(observation(0)) is trusted
