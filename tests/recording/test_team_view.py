"""The camera follows the team: every running agent is in its view at every tick."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from tests.recording.flights import straight_flight, wedge
from worldsim.judge.tick import Tick
from worldsim.recording import layout
from worldsim.recording.blueprint import EYE_DIRECTION, EYE_DISTANCE
from worldsim.recording.columns import ColumnBlock
from worldsim.recording.team_view import LEAST_RADIUS_M, TeamView

AGENTS, TICK_HZ = 5, 20


def flight(position_of: Callable[[float], np.ndarray], dead: tuple[int, ...] = ()) -> list[Tick]:
    """Ticks of agents at given positions (N, 3) over time; some are dead after a second."""
    rows = []
    for tick in straight_flight(wedge(AGENTS, duration_s=6.0)):
        running = ~np.isin(np.arange(AGENTS), dead if tick.time_s >= 1.0 else ())
        position = position_of(tick.time_s)
        target = position.astype(np.float32)
        rows.append(replace(tick, position=position, target=target, alive=running))
    return rows


def blocks_of(ticks: list[Tick]) -> list[ColumnBlock]:
    view = TeamView(1.0 / TICK_HZ)
    starts = range(0, len(ticks), TICK_HZ)
    return [block for at in starts for block in view.blocks(ticks[at : at + TICK_HZ])]


def numbers(blocks: list[ColumnBlock], entity: str, component: str) -> np.ndarray:
    """Return all rows of a component of vectors (T, 3)."""
    columns = [
        column.as_arrow_array().flatten().flatten().to_numpy(zero_copy_only=False)
        for block in blocks
        if block.entity == entity
        for column in block.columns
        if str(column.component_descriptor().component) == component
    ]
    return np.concatenate(columns).reshape(-1, 3)


START = np.random.default_rng(3).uniform(-2.0, 2.0, (AGENTS, 3))


def moving(time_s: float) -> np.ndarray:
    return START + np.array([2.0 * time_s, -time_s, 0.5 * time_s])


def spreading(time_s: float) -> np.ndarray:
    return START * (1.0 + 3.0 * time_s)


def leaving_one(time_s: float) -> np.ndarray:
    """All fly on but agent 0, which is dead and hovers where it died."""
    position = moving(2.0 * time_s)
    position[0] = START[0]
    return position


def arriving(time_s: float) -> np.ndarray:
    position = START.copy()
    position[4] = np.nan if time_s < 2.0 else (9.0, 0.0, 0.0)
    return position


@pytest.mark.parametrize(
    ("position_of", "dead"),
    [(moving, ()), (spreading, ()), (leaving_one, (0,)), (arriving, ())],
)
def test_every_running_agent_is_in_view(
    position_of: Callable[[float], np.ndarray], dead: tuple[int, ...]
) -> None:
    ticks = flight(position_of, dead)
    blocks = blocks_of(ticks)
    centres = numbers(blocks, layout.TEAM, "Transform3D:translation")
    scales = numbers(blocks, layout.TEAM, "Transform3D:scale")
    assert len(centres) == len(ticks)
    eye = EYE_DISTANCE * EYE_DIRECTION / np.linalg.norm(EYE_DIRECTION)
    for tick, centre, scale in zip(ticks, centres, scales, strict=True):
        shown = (tick.position[tick.alive] - centre) / scale
        shown = shown[np.isfinite(shown).all(axis=1)]
        assert np.linalg.norm(shown, axis=1).max() <= 1.0
        away = shown - eye
        cosine = away @ -eye / np.linalg.norm(away, axis=1) / np.linalg.norm(eye)
        assert np.degrees(np.arccos(cosine)).max() < 27.5, "half the camera's opening"


def test_the_view_does_not_zoom_out_to_a_vehicle_left_behind() -> None:
    scales = numbers(blocks_of(flight(leaving_one, (0,))), layout.TEAM, "Transform3D:scale")
    assert scales[-1, 0] < 9.0, "agent 0 is 27 m away at the end"


def test_targets_are_in_view() -> None:
    ticks = [replace(tick, target=tick.target + 0.5) for tick in flight(moving)]
    ticks[9].target[0] = np.nan
    blocks = blocks_of(ticks)
    centres = numbers(blocks, layout.TEAM, "Transform3D:translation")
    scales = numbers(blocks, layout.TEAM, "Transform3D:scale")
    shown = [(tick.target - c) / s for tick, c, s in zip(ticks, centres, scales, strict=True)]
    assert np.nanmax(np.linalg.norm(shown, axis=2)) <= 1.0


def test_targets_far_away_do_not_make_the_team_a_dot() -> None:
    ticks = [replace(tick, target=tick.target + 100.0) for tick in flight(lambda _: START)]
    scales = numbers(blocks_of(ticks), layout.TEAM, "Transform3D:scale")
    team_m = np.linalg.norm(START - 0.5 * (START.min(axis=0) + START.max(axis=0)), axis=1).max()
    assert scales.max() <= 1.7 * team_m


def test_a_single_agent_is_not_a_point_in_the_view() -> None:
    blocks = blocks_of(flight(lambda _: np.ones((AGENTS, 3))))
    assert (numbers(blocks, layout.TEAM, "Transform3D:scale") >= LEAST_RADIUS_M).all()


def test_the_ground_rests_in_the_world_and_stays_below_the_team() -> None:
    blocks = blocks_of(flight(moving))
    places = numbers(blocks, layout.GROUND, "Transform3D:translation")
    assert 3 <= len(places) < 30, "only where it moves on by a cell"
    grids = [b for b in blocks if b.entity == layout.GROUND and "LineStrips" in str(b.columns)]
    assert len(grids) <= 2
    np.testing.assert_allclose(places, np.rint(places), atol=1e-6)
    assert (places[:, 2] < -0.5).any()
