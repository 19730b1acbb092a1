"""Symmetric deadlocks are resolved: two agents that must swap, and an obstacle ahead (E23)."""

from pathlib import Path

import pytest

from worldsim.engine.virtual import fly
from worldsim.scenario.file import load, parse

HEAD_ON = Path(__file__).parents[2] / "deploy" / "scenarios" / "head-on-1.toml"
WITHIN_S = 20.0
SWAP = """
duration_s = 24.0
[fleet]
agents = 2
start = {{ kind = "list", positions_m = {starts}, yaws_deg = {yaws} }}
[vehicle]
kind = "{kind}"
[control]
controller = "tests.closed_loop.swapping:Swapping"
[formation]
name = "ends"
vertices = {{ V1 = {ends[0]}, V2 = {ends[1]} }}
[[formation.queue]]
name = "Q1"
vertices = ["V1"]
shape = {{ kind = "ray", direction = [-1, 0, 0] }}
[[formation.queue]]
name = "Q2"
vertices = ["V2"]
shape = {{ kind = "ray", direction = [1, 0, 0] }}
"""
STARTS = {
    "face to face": [[2, 0, 0], [-2, 0, 0]],
    "a micrometre aside": [[2, 1e-6, 0], [-2, 0, 0]],
    "a micrometre above": [[2, 0, 1e-6], [-2, 0, 0]],
    "upright": [[2, 0.02, 0.3], [-2, 0, -0.3]],
}


@pytest.mark.parametrize("kind", ["kinematic", "accelerating", "forward"])
@pytest.mark.parametrize("starts", STARTS.values(), ids=STARTS.keys())
@pytest.mark.pure
def test_two_agents_that_must_swap_pass_each_other(starts: list[list[float]], kind: str) -> None:
    assert_they_pass(starts, kind, "[180, 0]", ("[-2, 0, 0]", "[2, 0, 0]"))


@pytest.mark.parametrize("kind", ["kinematic", "accelerating", "forward"])
@pytest.mark.parametrize("aside_m", [0.0, 0.02, 0.2])
@pytest.mark.parametrize("yaws", ["[0, 0]", "[90, 0]"])
@pytest.mark.pure
def test_two_that_must_swap_one_above_the_other_pass_whatever_their_headings(
    aside_m: float, kind: str, yaws: str
) -> None:
    starts = [[aside_m, 0, 1.2], [0, 0, -1.2]]
    assert_they_pass(starts, kind, yaws, ("[0, 0, -1]", "[0, 0, 1]"))


def assert_they_pass(
    starts: list[list[float]], kind: str, yaws: str, ends: tuple[str, str]
) -> None:
    text = SWAP.format(starts=starts, kind=kind, yaws=yaws, ends=ends)
    judge = fly(parse(text)).loop.judge
    assert judge.phases[0].converge_s is not None
    assert judge.phases[0].converge_s <= WITHIN_S
    assert judge.min_separation_m is not None
    assert 0.25 <= judge.min_separation_m < 1.0, "they met, and passed"


@pytest.mark.parametrize("avoidance", ["constellation", "direct", "none"])
@pytest.mark.parametrize("off_m", [0.0, 1e-6, 1e-3])
def test_a_sphere_straight_ahead_is_passed(off_m: float, avoidance: str) -> None:
    ball = f"[{{ shape = 'sphere', centre_m = [3, {off_m}, 0], radius_m = 0.5 }}]"
    judge = fly(load(HEAD_ON, {"obstacle": ball, "control.avoidance": avoidance})).loop.judge
    assert judge.phases[0].converge_s is not None
    assert judge.phases[0].converge_s <= WITHIN_S
    assert judge.min_obstacle_distance_m is not None
    assert judge.min_obstacle_distance_m >= 0.5
