"""The recorded hierarchy: tiers, parents, roles and queue residuals."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from rerun.chunk import Chunk, RrdReader

from agent.messages import DISTRESS, MEMBER, SUB_VERTEX, VERTEX
from tests.recording.flights import record, straight_flight, wedge
from worldsim.judge.tick import NO_ROLE, HierarchyRows, Tick
from worldsim.judge.verdict import Figures
from worldsim.recording import layout
from worldsim.recording.columns import ColumnBlock
from worldsim.recording.hierarchy_columns import HierarchyColumns, parent_lines
from worldsim.recording.recorder import RunRecorder
from worldsim.recording.situation import Situations

AGENTS = 5
PARENT = (-1, 0, 1, 1, -1)
TIER = (0, 1, 2, 2, -1)
ROLE = (VERTEX, SUB_VERTEX, MEMBER, MEMBER, DISTRESS)
NO_FIGURES = Figures(separation=np.zeros(AGENTS), slot_error=np.zeros(AGENTS), converged=False)


def hierarchy(role: tuple[int, ...] = ROLE) -> HierarchyRows:
    return HierarchyRows(
        tier=np.array(TIER, dtype=np.int16),
        parent=np.array(PARENT, dtype=np.int32),
        role=np.array(role, dtype=np.int8),
        record_age_s=np.full(AGENTS, 0.3, dtype=np.float32),
    )


def ticks() -> list[Tick]:
    """Two seconds; after the first, the agent in distress is a member."""
    found = (*ROLE[:-1], MEMBER)
    return [
        replace(
            tick,
            hierarchy=hierarchy(ROLE if tick.time_s < 1.0 else found),
            filtered_mps=np.full(AGENTS, 0.25, dtype=np.float32),
        )
        for tick in straight_flight(wedge(AGENTS, duration_s=2.0))
    ]


@pytest.fixture(scope="module")
def chunks(tmp_path_factory: pytest.TempPathFactory) -> list[Chunk]:
    path: Path = tmp_path_factory.mktemp("hierarchy") / "run.rrd"
    scenario = wedge(AGENTS, duration_s=2.0)
    record(RunRecorder(path, scenario, "hierarchy", mode="virtual"), scenario, ticks())
    return list(RrdReader(path).stream())


def rows(chunks: list[Chunk], entity: str, component: str) -> list[list[object]]:
    batches = [
        chunk.to_record_batch()
        for chunk in chunks
        if chunk.entity_path == entity and not chunk.is_static
    ]
    having = [batch.column(component) for batch in batches if component in batch.schema.names]
    return [row for column in having for row in column.to_pylist()]


def test_figures_have_a_row_four_times_a_second(chunks: list[Chunk]) -> None:
    for entity, first in (
        ("/metrics/tier", [0.0, 1.0, 2.0, 2.0, -1.0]),
        ("/metrics/record_age", pytest.approx([0.3] * AGENTS)),
        ("/metrics/neighbours", [4.0] * AGENTS),
        ("/metrics/safety_filter", [0.25] * AGENTS),
    ):
        found = rows(chunks, entity, "Scalars:scalars")
        assert len(found) == 2 * 4 + 1
        assert found[0] == first


def test_each_queue_has_a_residual_of_its_own(chunks: list[Chunk]) -> None:
    found = rows(chunks, "/metrics/queue_residual", "Scalars:scalars")
    assert {len(row) for row in found} == {4}
    assert len(found) == 2 * 4 + 1


def test_each_agent_with_a_parent_has_a_line_to_it(chunks: list[Chunk]) -> None:
    found = rows(chunks, "/world/hierarchy", "LineStrips3D:strips")
    assert {len(row) for row in found} == {3}
    tick = ticks()[0]
    ends, tiers = parent_lines(tick.position, hierarchy())
    assert tiers.tolist() == [1, 2, 2]
    np.testing.assert_array_equal(ends[0], tick.position[[1, 0]])


def test_a_vehicle_that_left_has_neither_label_nor_tier() -> None:
    there, gone = ticks()[0], ticks()[20]
    gone.position[4] = np.nan
    gone.hierarchy.role[4] = NO_ROLE  # type: ignore[union-attr]
    columns = HierarchyColumns(20.0, AGENTS, 4)
    situations = [Situations(AGENTS, wedge(AGENTS).netem).at(there)] * 2
    drawn = [
        *columns.blocks([there, gone], situations),
        *columns.figures([there, gone], [NO_FIGURES] * 2),
    ]
    labels = last_row(drawn, layout.VEHICLES)
    assert labels == ["a0 vertex", "a1 sub-vertex 1", "a2", "a3", ""]
    np.testing.assert_array_equal(last_row(drawn, layout.TIER), [0.0, 1.0, 2.0, 2.0, np.nan])


def last_row(drawn: list[ColumnBlock], entity: str) -> list[object]:
    (column,) = [each for block in drawn if block.entity == entity for each in block.columns]
    latest: list[object] = column.as_arrow_array().to_pylist()[-1]
    return latest


def test_labels_and_roles_have_a_row_where_they_change(chunks: list[Chunk]) -> None:
    labels = rows(chunks, "/world/vehicles", "Boxes3D:labels")
    assert [row for row in labels if row] == [
        ["a0 vertex", "a1 sub-vertex 1", "a2", "a3", "a4 distress"],
        ["a0 vertex", "a1 sub-vertex 1", "a2", "a3", "a4"],
    ]
    assert rows(chunks, "/roles/a4", "StateChange:state") == [["distress"], ["member"]]
    assert rows(chunks, "/roles/a0", "StateChange:state") == [["vertex"]]
