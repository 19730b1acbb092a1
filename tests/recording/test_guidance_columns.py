"""Cast-zones, bobber points and ways: those of Fig. 5, where each vehicle is and points."""

from dataclasses import replace

import msgspec
import numpy as np

from agent.config import Vehicle
from tests.recording.flights import straight_flight, wedge
from worldsim.judge.tick import Tick
from worldsim.recording import layout
from worldsim.recording.guidance_columns import GuidanceColumns
from worldsim.scenario.tables import Scenario

SCENARIO = msgspec.structs.replace(
    wedge(2, duration_s=0.5), vehicle=Vehicle(max_turn_left_deg=30.0, max_turn_right_deg=60.0)
)


def drawn(scenario: Scenario, tick: Tick, entity: str) -> list[np.ndarray]:
    """Return the points (P, 3) of each shape that an entity draws at a tick."""
    blocks = list(GuidanceColumns(scenario).blocks([tick]))
    return [
        np.array(shape, dtype=np.float64).reshape(-1, 3)
        for block in blocks
        if block.entity == entity
        for column in block.columns
        for row in column.as_arrow_array().to_pylist()
        for shape in row
    ]


def facing_x(targets: list[tuple[float, float, float]]) -> Tick:
    """Return a tick of two vehicles at (0, 0, 1) and (5, 0, 1) that point along +x."""
    tick = next(straight_flight(SCENARIO))
    return replace(
        tick,
        position=np.array([(0.0, 0.0, 1.0), (5.0, 0.0, 1.0)]),
        attitude=np.zeros((2, 3), dtype=np.float32),
        target=np.array(targets, dtype=np.float32),
    )


def test_a_zone_lies_ahead_within_the_limits_of_each_side() -> None:
    zone, other = drawn(SCENARIO, facing_x([(3, 0, 1), (9, 0, 1)]), layout.CAST_ZONES)
    np.testing.assert_allclose(zone[0], (0.0, 0.0, 1.0))
    angles = np.degrees(np.arctan2(zone[1:-1, 1], zone[1:-1, 0]))
    np.testing.assert_allclose([angles.min(), angles.max()], [-60.0, 30.0], atol=1e-3)
    np.testing.assert_allclose(other - zone, np.tile((5.0, 0.0, 0.0), (len(zone), 1)), atol=1e-5)


def test_a_bobber_lies_on_the_way_within_the_cone() -> None:
    ahead, aside = drawn(SCENARIO, facing_x([(3, 0, 1), (5, 9, 1)]), layout.WAYS)
    np.testing.assert_allclose(ahead[[0, 2]], [(0, 0, 1), (3, 0, 1)], atol=1e-6)
    assert 0.0 < ahead[1, 0] < 3.0
    assert ahead[1, 1] == 0.0
    x, y, _ = aside[1] - aside[0]
    assert 0.0 < np.degrees(np.arctan2(y, x)) < 30.0, "the target is at 90 deg to the left"
    points = drawn(SCENARIO, facing_x([(3, 0, 1), (5, 9, 1)]), layout.BOBBERS)
    np.testing.assert_allclose(np.concatenate(points), [ahead[1], aside[1]])


def test_an_agent_without_a_target_or_at_it_has_no_way() -> None:
    assert not drawn(SCENARIO, facing_x([(np.nan,) * 3, (5, 0, 1)]), layout.WAYS)


def test_a_large_fleet_has_none() -> None:
    large = wedge(layout.NAMED_MAX + 1, duration_s=0.1)
    assert not list(GuidanceColumns(large).blocks([next(straight_flight(large))]))
