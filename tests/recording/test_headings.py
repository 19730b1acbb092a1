"""Vehicles with a heading, and the limits of their turns: by side and by agent."""

from pathlib import Path

import msgspec
import numpy as np
import pytest
from rerun.chunk import Chunk, RrdReader

from agent.config import Vehicle
from tests.recording.flights import record, straight_flight, wedge
from worldsim.recording import layout
from worldsim.recording.recorder import RunRecorder
from worldsim.recording.static_entities import turn_limits
from worldsim.scenario.tables import AgentTable, Scenario, VehicleChange


def differing() -> Scenario:
    """Agents that may turn 45 deg; but agent 2 only 20 deg to the left, and agent 3 30 deg."""
    tables = (
        AgentTable(ids=(2,), vehicle=VehicleChange(max_turn_left_deg=20.0)),
        AgentTable(ids=(3,), vehicle=VehicleChange(max_turn_deg=30.0)),
    )
    scenario = wedge(4, duration_s=1.0)
    return msgspec.structs.replace(scenario, vehicle=Vehicle(), agent=tables)


def test_turn_limits_name_their_side_and_agents() -> None:
    assert turn_limits(wedge(4)) == {45.0: "limit to the left", -45.0: "limit to the right"}
    assert turn_limits(differing()) == {
        45.0: "limit to the left of a0, a1",
        20.0: "limit to the left of a2",
        30.0: "limit to the left of a3",
        -45.0: "limit to the right of a0, a1, a2",
        -30.0: "limit to the right of a3",
    }


@pytest.fixture(scope="module")
def chunks(tmp_path_factory: pytest.TempPathFactory) -> list[Chunk]:
    path: Path = tmp_path_factory.mktemp("headings") / "run.rrd"
    scenario = differing()
    recorder = RunRecorder(path, scenario, "headings", mode="virtual")
    record(recorder, scenario, list(straight_flight(scenario)))
    return list(RrdReader(path).stream())


def test_the_turn_panel_has_every_limit(chunks: list[Chunk]) -> None:
    limits = [each for each in chunks if each.entity_path == "/metrics/turn_deg/limit"]
    drawn = [
        each.to_record_batch().column("Scalars:scalars").to_pylist()[0]
        for each in limits
        if not each.is_static
    ]
    assert sorted(drawn[0]) == sorted(turn_limits(differing()))


def test_arrows_point_where_vehicles_do(chunks: list[Chunk]) -> None:
    flown = list(straight_flight(differing()))
    rows = [each.to_record_batch() for each in chunks if each.entity_path == layout.VEHICLES]
    moving = [row for row in rows if "Arrows3D:vectors" in row.schema.names]
    vectors, origins = (
        np.array([each for row in moving for each in row.column(component).to_pylist()])
        for component in ("Arrows3D:vectors", "Arrows3D:origins")
    )
    assert len(vectors) == len(flown)
    for tick, ahead, origin in zip(flown, vectors, origins, strict=True):
        np.testing.assert_allclose(origin, tick.position, atol=1e-6)
        np.testing.assert_allclose(np.arctan2(*ahead.T[1::-1]), tick.attitude[:, 0], atol=1e-5)
