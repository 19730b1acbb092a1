"""A vehicle that cannot give way is not at fault where a moving obstacle comes too near."""

from collections.abc import Callable
from dataclasses import replace

import msgspec
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from agent.config import Vehicle
from tests.recording.flights import straight_flight, wedge
from worldsim.engine.virtual import fly
from worldsim.judge.verdict import Judge
from worldsim.results.expectation_text import encounter_texts
from worldsim.scenario.file import parse
from worldsim.scenario.obstacle_tables import Sphere
from worldsim.scenario.tables import Expectations

BOUND_M = 0.5
RADIUS_M = 0.5
TICKS = 160
LIMIT_MPS = 0.5
"""The vehicles' speed limit."""

Motion = Callable[[float], float]


def passing(speed_mps: float) -> Sphere:
    """Return a ball that passes the origin 4 s after the start, and goes on."""
    start = (-4.0 * speed_mps, 0.0, 0.0)
    end = (40.0 * speed_mps, 0.0, 0.0)
    return Sphere(waypoints_m=(start, end), speed_mps=speed_mps, radius_m=RADIUS_M)


def judged(ball: Sphere, alive: Callable[[float], bool], x_m: Motion = lambda _: 0.0) -> Judge:
    """Return a judge that saw a ball meet one vehicle, which is at ``x_m`` [m] on the x axis."""
    scenario = msgspec.structs.replace(
        wedge(1, duration_s=TICKS / 20),
        vehicle=Vehicle(max_speed_mps=LIMIT_MPS),
        obstacle=(ball,),
        expect=Expectations(converge=False, min_obstacle_distance_m=BOUND_M),
    )
    judge = Judge(scenario)
    for tick in straight_flight(scenario):
        runs = np.array([alive(tick.time_s)])
        judge.see(replace(tick, alive=runs, position=np.array([[x_m(tick.time_s), 0.0, 0.0]])))
    return judge


def fails(judge: Judge) -> bool:
    violated = judge.invariants()["I1"].violations > 0
    assert violated is not judge.expectations()[1].held
    return violated


@settings(max_examples=12, deadline=None)
@given(speed_mps=st.floats(0.3, 5.0), dead_from_s=st.floats(0.0, 0.5))
def test_a_dead_vehicle_is_not_at_fault(speed_mps: float, dead_from_s: float) -> None:
    judge = judged(passing(speed_mps), lambda t: t < dead_from_s)
    assert not fails(judge)
    (encounter,) = judge.clearance.encounters
    assert (encounter.agent, encounter.obstacle, encounter.hindrance) == (0, 0, "not running")
    assert encounter.distance_m == judge.min_obstacle_distance_m < 0.0


@settings(max_examples=12, deadline=None)
@given(speed_mps=st.floats(0.3, LIMIT_MPS))
def test_a_running_vehicle_that_could_give_way_is_at_fault(speed_mps: float) -> None:
    judge = judged(passing(speed_mps), lambda _: True)
    assert fails(judge)
    assert judge.clearance.encounters == []


def test_a_vehicle_that_dies_too_near_was_at_fault_before() -> None:
    assert fails(judged(passing(0.4), lambda t: t < 3.5))


def test_a_vehicle_that_returns_within_a_ball_is_excused_until_it_is_clear() -> None:
    within, after = (lambda t: not 1.0 < t < 4.0), (lambda t: t > 4.0)
    assert not fails(judged(passing(0.45), within))
    follows: Motion = lambda t: 0.0 if t < 7.0 else 3.0 * (t - 7.0)  # noqa: E731
    assert fails(judged(passing(0.45), after, follows))


def test_a_dead_vehicle_that_hits_a_resting_ball_is_at_fault() -> None:
    """Its controller let it come too fast."""
    rest = Sphere(centre_m=(0.0, 0.0, 0.0), radius_m=RADIUS_M)
    assert fails(judged(rest, lambda _: False, lambda t: -1.5 + 0.3 * t))


@settings(max_examples=12, deadline=None)
@given(speed_mps=st.floats(LIMIT_MPS + 0.01, 5.0), toward_mps=st.floats(0.05, LIMIT_MPS))
def test_a_vehicle_that_flies_at_a_faster_ball_is_at_fault(
    speed_mps: float, toward_mps: float
) -> None:
    assert fails(judged(passing(speed_mps), lambda _: True, lambda t: toward_mps * (4.0 - t)))


@settings(max_examples=12, deadline=None)
@given(speed_mps=st.floats(LIMIT_MPS + 0.01, 5.0), away_mps=st.floats(0.0, LIMIT_MPS))
def test_a_vehicle_that_flees_from_a_faster_ball_is_not_at_fault(
    speed_mps: float, away_mps: float
) -> None:
    judge = judged(passing(speed_mps), lambda _: True, lambda t: max(0.0, away_mps * (t - 3.0)))
    assert not fails(judge)
    assert all(each.hindrance == "outrun" for each in judge.clearance.encounters)


def test_encounters_are_named_in_a_few_lines() -> None:
    row = {"t_s": 3.0, "agent": 2, "obstacle": 0, "distance_m": 0.236, "hindrance": "not running"}
    (line,) = encounter_texts([row])  # type: ignore[list-item]
    assert line == (
        "obstacle[0] came within 0.236 m of a2 at 3 s: not counted,"
        " a vehicle whose agent is not running cannot give way"
    )
    assert encounter_texts([row] * 9)[-1] == "and 5 more times"  # type: ignore[list-item]


@pytest.mark.parametrize("strike", ['kill = ["all"]', 'pause = ["all"]'])
def test_a_fleet_that_cannot_move_does_not_fail_for_a_ball(strike: str) -> None:
    judge = fly(
        parse(f"""
name = "struck"
duration_s = 12.0
[fleet]
agents = 2
start = {{ kind = "list", positions_m = [[0, 0, 0], [0, 2, 0]] }}
[formation]
name = "line"
vertices = {{ V1 = [0, 0, 0] }}
queue = [{{ name = "Q", vertices = ["V1"], shape = {{ kind = "ray", direction = [0, 1, 0] }} }}]
[[obstacle]]
shape = "sphere"
waypoints_m = [[-4, 0, 0], [4, 0, 0]]
speed_mps = 0.4
radius_m = 0.5
[[event]]
at_s = 0.2
{strike}
[expect]
converge = false
""")
    ).loop.judge
    assert not any(judge.shortcomings())
    assert judge.min_obstacle_distance_m is not None
    assert judge.min_obstacle_distance_m < 0.0
    assert [each.agent for each in judge.clearance.encounters] == [0]
