"""What an agent doubts: readings that never change, scans that do not come, neighbours unseen."""

from array import array
from random import Random

import pytest

from agent.config import Sensors
from agent.messages import Observation, Scan
from agent.sensing.ray_pattern import pattern_of
from agent.sensing.sensor_health import LOOKS, PROXIMITY, SensorHealth
from tests.agent.comms.making import beacon

LASER = pattern_of("laser", Sensors(), 20.0)
ECHO = Scan(0, array("H", [1000] * 61).tobytes())
NONE = Scan(0, array("H", [0xFFFF] * 61).tobytes())


def seen(tick, x=0.0, vehicles=(), scans=(), obstacles=()):
    at = (x, 0.0, 0.0)
    return Observation(4 * tick, 0.05 * tick, at, (0.0,) * 3, 0.0, vehicles, obstacles, (), scans)


def trust(patterns=(), ranging=True, noisy=(PROXIMITY, 0)):
    return SensorHealth(patterns, ranging, frozenset(noisy), 20.0, 0.5)


def test_a_reading_that_stays_while_one_moves_is_doubted_until_it_changes():
    watch, body = trust(), ((1.0, 0.0, 0.0),)
    believed = [watch.note(seen(tick, 0.01 * tick, body)) for tick in range(8)]
    assert believed == [True] * 4 + [False] * 4
    assert watch.note(seen(9, 0.1, ((0.9, 0.0, 0.0),)))


def test_who_stands_may_read_the_same_for_ever_and_so_may_who_sees_nothing():
    watch = trust()
    assert all(watch.note(seen(tick, 0.0, ((1.0, 0.0, 0.0),))) for tick in range(50))
    assert all(trust().note(seen(tick, 0.1 * tick)) for tick in range(50))
    scanning = trust((LASER,))
    assert all(scanning.note(seen(tick, 0.1 * tick, scans=(NONE,))) for tick in range(50))


def test_without_noise_who_flies_side_by_side_reads_the_same():
    watch = trust(noisy=())
    assert all(watch.note(seen(tick, 0.1 * tick, ((1.0, 0.0, 0.0),))) for tick in range(50))


def test_without_noise_who_flies_along_a_wall_reads_the_same_but_nobody_who_comes_nearer():
    along, towards = trust(noisy=()), trust(noisy=())
    beside, ahead = ((0.0, 1.25, 0.0),), ((1.25, 0.0, 0.0),)
    assert all(along.note(seen(tick, 0.1 * tick, obstacles=beside)) for tick in range(50))
    assert not all(towards.note(seen(tick, 0.01 * tick, obstacles=ahead)) for tick in range(8))


def test_scans_that_do_not_come_are_missed():
    watch = trust((LASER,), ranging=False)
    assert watch.note(seen(0, scans=(ECHO,)))
    assert [watch.note(seen(tick)) for tick in (2, 6, 7, 20)] == [True, True, False, False]
    assert watch.note(seen(21, 0.5, scans=(NONE,)))


@pytest.mark.parametrize(("bodies", "believed"), [((), False), (((1.0, 0.1, 0.0),), True)])
def test_a_neighbour_near_by_must_be_sensed(bodies, believed):
    watch = trust()
    for look in range(LOOKS):
        there = beacon(1, look, stamp_s=0.01 * look, at=(1.0, 0.0, 0.0))
        watch.compare(seen(0, vehicles=bodies), [there])
    assert watch.note(seen(0, vehicles=bodies)) is believed


def test_old_word_and_far_neighbours_prove_nothing():
    watch = trust()
    old, far = (
        beacon(1, 1, stamp_s=0.0, at=(1.0, 0.0, 0.0)),
        beacon(2, 1, stamp_s=2.0, at=(1.5, 0.0, 0.0)),
    )
    for _ in range(2 * LOOKS):
        watch.compare(seen(40), [old, far])
    assert watch.note(seen(40))


def test_who_was_blind_believes_again_once_it_sees_a_neighbour_not_once_they_have_gone():
    watch, body = trust(), ((1.0, 0.0, 0.0),)
    there, gone = (beacon(1, 1, stamp_s=0.0, at=(x, 0.0, 0.0)) for x in (1.0, 5.0))
    for look in range(LOOKS):
        speaking = beacon(1, look, stamp_s=0.01 * look, at=(1.0, 0.0, 0.0))
        watch.compare(seen(0), [speaking])
    for _ in range(2 * LOOKS):
        watch.compare(seen(0), [gone])
        assert not watch.note(seen(0))
    for _ in range(LOOKS):
        assert not watch.note(seen(0))
        watch.compare(seen(0, vehicles=body), [there])
    assert watch.note(seen(0, vehicles=body))


def test_scans_that_leap_time_after_time_are_wrong_and_quiet_ones_are_right_again():
    watch, random = trust((LASER,), ranging=False), Random(5)
    told = [random.randrange(1 << 16) for _ in range(61 * 8)]
    wild = [Scan(0, array("H", told[k : k + 61]).tobytes()) for k in range(0, len(told), 61)]
    believed = [watch.note(seen(2 * k, 0.1 * k, scans=(scan,))) for k, scan in enumerate(wild)]
    assert believed == [True] * 3 + [False] * 5
    calm = [Scan(0, array("H", [1000 + 10 * k] * 61).tobytes()) for k in range(5)]
    believed = [watch.note(seen(16 + 2 * k, 0.8, scans=(scan,))) for k, scan in enumerate(calm)]
    assert believed == [False] * 3 + [True] * 2


def test_a_neighbour_that_leaves_is_missed_once_and_no_proof_of_a_blind_sensor():
    watch = trust()
    gone = beacon(1, 7, 1.0, at=(1.0, 0.0, 0.0))
    for tick in range(20, 40, 2):
        watch.compare(seen(tick), [gone])
        assert watch.note(seen(tick))
