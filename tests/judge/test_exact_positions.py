"""Figures are those of the true positions, to a millimetre anywhere in the world."""

from dataclasses import replace

import msgspec
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.recording.flights import straight_flight, wedge
from worldsim.engine.virtual import fly
from worldsim.judge.verdict import Judge
from worldsim.scenario.file import parse
from worldsim.scenario.obstacle_tables import Sphere
from worldsim.scenario.tables import Expectations

EDGE_M = 1e6
"""The largest coordinate that a scenario allows."""
BOUND_M = 0.25
anywhere = st.tuples(*[st.floats(-EDGE_M, EDGE_M)] * 3).map(np.array)

HERE = """
name = "somewhere"
duration_s = 4.0
[fleet]
agents = 5
start = {{ kind = "box", centre_m = {at}, size_m = [4, 4, 3], spacing_m = 0.6 }}
[formation]
name = "line"
vertices = {{ V1 = [0, 0, 0] }}
queue = [{{ name = "Q", vertices = ["V1"], shape = {{ kind = "ray", direction = [-1, 0, 0] }} }}]
[netem]
range_m = 6.0
[frame]
waypoints_m = [{at}]
[[obstacle]]
shape = "sphere"
centre_m = {beside}
radius_m = 0.5
"""


def judged(positions: np.ndarray, obstacles: tuple[Sphere, ...] = ()) -> Judge:
    """Return a judge that saw two vehicles hover for a tick."""
    scenario = wedge(2)
    expect = Expectations(min_separation_m=BOUND_M, converge=False)
    judge = Judge(msgspec.structs.replace(scenario, expect=expect, obstacle=obstacles))
    first, second, *_ = straight_flight(scenario)
    for tick in (first, second):
        judge.see(replace(tick, position=positions))
    return judge


@given(centre=anywhere, away_m=st.floats(0.0, 5.0))
def test_a_separation_is_true_anywhere(centre: np.ndarray, away_m: float) -> None:
    ends = np.array([centre, centre + np.array([away_m, 0, 0])])
    assert judged(ends).min_separation_m == pytest.approx(away_m, abs=1e-9)


@given(centre=anywhere, away_m=st.floats(0.6, 5.0))
def test_an_obstacle_distance_is_true_anywhere(centre: np.ndarray, away_m: float) -> None:
    ball = Sphere(centre_m=tuple(centre), radius_m=0.5)
    ends = np.array([centre + np.array([0, away_m, 0]), centre + np.array([9, 0, 0])])
    found = judged(ends, (ball,)).min_obstacle_distance_m
    assert found == pytest.approx(away_m - 0.5, abs=1e-9)


@given(x_cm=st.integers(-(10**8), 10**8 - 25), short_m=st.sampled_from((0.0, 1e-6)))
def test_a_distance_of_exactly_the_bound_keeps_it(x_cm: int, short_m: float) -> None:
    """Decimal starts such as 0.14 and 0.39 are 0.25 m apart but for their rounding."""
    ends = np.array([[x_cm / 100 + short_m, 0.0, 0.0], [(x_cm + 25) / 100, 0.0, 0.0]])
    judge = judged(ends)
    held = short_m == 0.0
    assert (judge.invariants()["I1"].violations == 0) is held
    assert judge.expectations()[0].held is held


@settings(max_examples=5, deadline=None)
@given(centre=st.tuples(*[st.integers(-900_000, 900_000)] * 3))
def test_a_flight_far_away_has_the_figures_of_the_flight_at_the_origin(
    centre: tuple[int, int, int],
) -> None:
    figures = []
    for at in ((0, 0, 0), centre):
        beside = [at[0] + 3, at[1] + 3, at[2]]
        judge = fly(parse(HERE.format(at=list(at), beside=beside))).loop.judge
        phase = judge.phases[0]
        figures.append([judge.min_separation_m, judge.min_obstacle_distance_m, phase.residual_m])
    np.testing.assert_allclose(*figures, atol=1e-3)
