"""Whole flights that once touched: blind, fast, noisy, and slowly approached vehicles.

Each measures the true distances slot by slot.
"""

from math import inf

import numpy as np
import pytest

from worldsim.engine.virtual import VirtualFleet
from worldsim.scenario.file import parse
from worldsim.scenario.tables import Scenario
from worldsim.truth.obstacles import Obstacles

D_OB, CLEARANCE = 0.25, 0.5
ROUNDING_M = 1e-9
LINE = """
[formation]
name = "line"
vertices = { V = [0, 0, 0] }
queue = [{ name = "Q", vertices = ["V"], shape = { kind = "ray", direction = [1, 0, 0] } }]
"""
BLIND_PAIR = """
duration_s = 20.0
[fleet]
agents = 2
start = { kind = "list", positions_m = [[-4, 0, 0], [4, 0, 0]] }
[vehicle]
sensors = []
[[event]]
at_s = %s
partition = [[0], [1]]
"""
BLIND_KILL = """
duration_s = 30.0
seed = %d
[fleet]
agents = 6
start = { kind = "box", size_m = [4, 4, 2], spacing_m = 0.6 }
[vehicle]
sensors = []
[[event]]
at_s = 2.0
kill = ["random:2"]
"""
BRAKES_SLOWLY = """
duration_s = 25.0
[fleet]
agents = 2
start = { kind = "list", positions_m = [[-6, 0, 0], [0, 0, 0]], yaws_deg = [0, 0] }
[vehicle]
kind = "accelerating"
max_speed_mps = 1.0
max_climb_mps = 1.0
max_accel_mps2 = 0.25
[frame]
waypoints_m = [[6, 0, 0]]
[[event]]
at_s = 0.1
kill = [1]
"""
SPIRALS = """
duration_s = 40.0
seed = %d
[fleet]
agents = 3
start = { kind = "box", size_m = [1, 1, 1], spacing_m = 0.3 }
[control]
controller = "tests.random_flights.controllers:Spiral"
[sensor.proximity]
noise_m = 0.05
"""
APPROACHED = """
duration_s = 40.0
[fleet]
agents = 1
start = { kind = "list", positions_m = [[0, 0, 0]] }
[vehicle]
max_speed_mps = %s
[sensor.proximity]
noise_m = %s
[[obstacle]]
shape = "sphere"
waypoints_m = [[%s, 0, 0], [0.1, 0, 0]]
speed_mps = %s
radius_m = 0.55
"""
RING = """
seed = %d
duration_s = 34.0
[fleet]
agents = 12
start = { kind = "box", size_m = [1.01, 1.01, 1.01], spacing_m = 0.25 }
[vehicle]
max_climb_mps = 0.15
[sensor.proximity]
noise_m = 0.005
[netem]
loss_percent = 50
delay_ms = 2000
[[obstacle]]
shape = "sphere"
waypoints_m = [[2, 6, 0], [-2, -6, 0]]
speed_mps = 0.25
radius_m = 0.5
"""


def scenario(text: str) -> Scenario:
    return parse(text + LINE)


def least_distances(flown: Scenario) -> tuple[float, float]:
    """Fly; return the least distances between vehicles, and of running ones to obstacles [m]."""
    fleet, obstacles = VirtualFleet(flown), Obstacles(flown.obstacle)
    apart = clear = inf
    for slot in range(1, flown.slots + 1):
        fleet.slot()
        position = fleet.loop.world.vehicles.position
        away = np.linalg.norm(position[:, None] - position[None], axis=2)
        away[np.diag_indices(len(away))] = inf
        apart = min(apart, float(away.min()))
        if flown.obstacle:
            distance, _ = obstacles.nearest(position, slot / flown.slot_hz)
            clear = min(clear, float(distance[fleet.loop.members.alive].min()))
    return apart, clear


@pytest.mark.parametrize("at_s", [0.0, 1.0, 3.0])
def test_two_that_only_hear_do_not_meet_when_parted(at_s: float) -> None:
    apart, _ = least_distances(scenario(BLIND_PAIR % at_s))
    assert apart >= D_OB


@pytest.mark.parametrize("seed", range(3))
def test_those_that_only_hear_do_not_hit_the_dead(seed: int) -> None:
    apart, _ = least_distances(scenario(BLIND_KILL % seed))
    assert apart >= D_OB


def test_a_vehicle_stops_before_what_it_sees_though_it_brakes_slowly() -> None:
    apart, _ = least_distances(scenario(BRAKES_SLOWLY))
    assert D_OB <= apart < 1.0


@pytest.mark.parametrize("seed", range(2))
def test_noise_lets_nobody_spiral_into_another(seed: int) -> None:
    apart, _ = least_distances(scenario(SPIRALS % seed))
    assert D_OB <= apart < 0.45


@pytest.mark.parametrize(("start", "speed"), [(1.1, 0.004), (1.1, 0.03), (1.6, 0.3)])
@pytest.mark.parametrize(("max_speed", "noise"), [(0.5, 0.0), (0.5, 0.01), (0.4, 0.05)])
def test_no_obstacle_is_too_slow_to_give_way_to(
    start: float, speed: float, max_speed: float, noise: float
) -> None:
    _, clear = least_distances(scenario(APPROACHED % (max_speed, noise, start, speed)))
    assert clear >= CLEARANCE - ROUNDING_M


def test_a_crowd_gives_way_to_a_ball() -> None:
    apart, clear = least_distances(scenario(RING % 3))
    assert apart >= D_OB - ROUNDING_M
    assert CLEARANCE - ROUNDING_M <= clear < 1.0
