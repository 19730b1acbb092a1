"""Scans of laser and sonar, and the independence of their noise."""

from array import array
from math import pi

import numpy as np
import pytest

from agent.config import SCANNERS, Laser, Sensors, Sonar, Vehicle
from agent.messages import NO_ECHO_MM
from agent.sensing.ray_pattern import pattern_of
from worldsim.scenario.obstacle_tables import Sphere, Wall
from worldsim.truth.obstacles import Obstacles
from worldsim.truth.scanning_sensors import ScanningSensors

BALL = Sphere(centre_m=(2.0, 0.0, 0.0), radius_m=0.5)
WALL = Wall(from_m=(-9, 1.0, -5), to_m=(9, 1.0, -5), height_m=10.0, thickness_m=0.0002)
NOISY = Sensors(
    laser=Laser(noise_m=0.02, dropout_percent=10), sonar=Sonar(noise_m=0.02, dropout_percent=10)
)
HERE = np.array([[0.0, 0.0, 0.0], [0.0, -1.0, 0.0], [np.nan] * 3])
YAW = np.array([0.0, pi / 2, np.nan])


PLANAR = Sensors(coverage="planar")


def scans(sensors=PLANAR, kinds=SCANNERS, obstacles=(), seed=1):
    vehicles = [Vehicle(sensors=kinds)] * 3
    return ScanningSensors(vehicles, sensors, seed, 20.0, Obstacles(obstacles))


def read(agents, slot=0, tick=0, **more):
    return scans(**more).read(HERE, YAW, agents, tick, slot, 0.0)


def ranges(scan):
    return [None if each == NO_ECHO_MM else each / 1000 for each in array("H", scan.ranges)]


def test_a_ball_ahead_is_seen_in_the_middle_of_the_laser():
    laser, _ = read([0], obstacles=[BALL])[0]
    seen = ranges(laser)
    assert seen[30] == 1.5
    assert [index for index in range(2, 61) if seen[index]] == list(range(26, 35))


def test_other_vehicles_are_seen_as_spheres_and_the_own_one_is_not():
    laser, sonar = read([1])[1]
    assert ranges(laser)[30] == 0.9
    assert ranges(sonar)[0] == 0.9
    assert set(ranges(laser)[2:29]) == {None}


def test_a_sonar_measures_the_nearest_point_in_its_beam():
    _, sonar = read([0], obstacles=[WALL])[0]
    seen = ranges(sonar)
    assert seen[4] == pytest.approx(1.0, abs=0.001)
    assert seen[5] == pytest.approx(1.02, abs=0.03)
    assert seen[0] is None


def test_up_and_down_look_up_and_down():
    sensors = Sensors(sonar=Sonar(up_down=True))
    above = Sphere(centre_m=(0, 0, 1.5), radius_m=0.5)
    seen = ranges(read([0], sensors=sensors, obstacles=[above])[0][1])
    assert (len(seen), seen[16], seen[17]) == (18, 1.0, None)


def test_the_defaults_look_all_round():
    around = [(0, 0, 1.5), (0, 0, -1.5), (-1.5, 0, 0), (0, 1.5, 0), (-1, 0, 1.1), (0.5, -0.3, -1.4)]
    for centre in around:
        ball = Sphere(centre_m=centre, radius_m=0.3)
        both = read([0], sensors=Sensors(), obstacles=[ball])[0]
        nearest = min(each for scan in both for each in ranges(scan)[:1037] if each is not None)
        assert nearest < 1.5


def test_planar_sees_nothing_above():
    above = Sphere(centre_m=(0.6, 0, 1.5), radius_m=0.5)
    for scan in read([0], obstacles=[above])[0]:
        assert all(each is None or each < 1.0 for each in ranges(scan))


def test_rings_look_above_and_below():
    sensors = Sensors(laser=Laser(rings=3, elevation_deg=30.0, rays=1))
    high = Sphere(centre_m=(3**0.5, 0, 1.0), radius_m=0.5)
    assert ranges(read([0], sensors=sensors, obstacles=[high])[0][0]) == [None, None, 1.5]


def test_noise_depends_on_agent_slot_and_seed_only():
    alone, together = (
        read([0], sensors=NOISY, obstacles=[WALL]),
        read([0, 1], sensors=NOISY, obstacles=[WALL]),
    )
    assert alone[0] == together[0]
    assert alone[0] != read([0], slot=4, sensors=NOISY, obstacles=[WALL])[0]
    assert alone[0] != read([0], seed=2, sensors=NOISY, obstacles=[WALL])[0]


def test_noise_and_dropouts_are_as_large_as_configured():
    sensors = Sensors(laser=Laser(noise_m=0.02, dropout_percent=10, rays=201, range_m=50))
    near = [
        ranges(read([0], slot=slot, sensors=sensors, obstacles=[WALL])[0][0]) for slot in range(50)
    ]
    true = ranges(
        read([0], sensors=Sensors(laser=Laser(rays=201, range_m=50)), obstacles=[WALL])[0][0]
    )
    rows = [k for k, far in enumerate(true) if far is not None and far < 8]
    errors = [row[k] - true[k] for row in near for k in rows if row[k] is not None]
    lost = sum(row[k] is None for row in near for k in rows)
    assert np.std(errors) == pytest.approx(0.02, rel=0.1)
    assert lost / (len(rows) * len(near)) == pytest.approx(0.1, abs=0.02)


def test_a_sensor_scans_at_its_rate_on_its_carriers_only():
    every = [bool(read([0], tick=tick)) for tick in range(4)]
    assert every == [True, False, True, False]
    assert read([0], kinds=("proximity",)) == {}
    assert not scans(kinds=("proximity",)).any


@pytest.mark.parametrize("kind", SCANNERS)
def test_a_pattern_is_of_unit_vectors(kind):
    pattern = pattern_of(kind, Sensors(laser=Laser(rings=5, elevation_deg=60)), 20.0)
    for beam in pattern.beams:
        assert np.sqrt((np.array(beam) ** 2).sum(axis=1)) == pytest.approx(1.0)
    assert [beam[0] for beam in pattern.beams] == list(pattern.axes)
