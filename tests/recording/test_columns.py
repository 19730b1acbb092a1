"""Blocks of one entity become one, and each component keeps the rows that it had."""

from pathlib import Path

import numpy as np
from rerun.chunk import RrdReader

from tests.recording.flights import record, straight_flight, wedge
from worldsim.recording import layout
from worldsim.recording.columns import ColumnBlock, merged
from worldsim.recording.components import BOX_COLOURS, BOX_LABELS, SCALARS
from worldsim.recording.recorder import DETAIL_BLOCKS, RunRecorder

COLOURS = BOX_COLOURS.rows(np.array([[1, 2], [3, 4], [5, 6]]))


def listed(block: ColumnBlock) -> dict[str, list[object]]:
    return {
        str(column.component_descriptor().component): column.as_arrow_array().to_pylist()
        for column in block.columns
    }


def test_a_component_without_a_row_is_null_there() -> None:
    labels = BOX_LABELS.rows(["a0", "a1", "b0", "b1"], 2)
    (block,) = merged(
        [ColumnBlock("/a", [0, 2, 5], [COLOURS]), ColumnBlock("/a", [1, 5], [labels])]
    )
    assert list(block.rows) == [0, 1, 2, 5]
    assert listed(block) == {
        "Boxes3D:colors": [[1, 2], None, [3, 4], [5, 6]],
        "Boxes3D:labels": [None, ["a0", "a1"], None, ["b0", "b1"]],
    }


def test_blocks_of_the_same_component_or_of_no_time_stay_apart() -> None:
    blocks = [
        ColumnBlock("/a", [0, 1, 2], [COLOURS]),
        ColumnBlock("/a", [3, 4, 5], [COLOURS]),
        ColumnBlock("/a", (), [BOX_LABELS.rows(["a"])]),
        ColumnBlock("/b", [0], [SCALARS.rows(np.array([[0.5]]))]),
    ]
    assert [(each.entity, list(each.rows)) for each in merged(blocks)] == [
        ("/a", [0, 1, 2]),
        ("/a", [3, 4, 5]),
        ("/a", []),
        ("/b", [0]),
    ]


def test_a_finished_recording_has_its_figures_to_the_last_tick(tmp_path: Path) -> None:
    scenario = wedge(4, duration_s=DETAIL_BLOCKS + 1.5)
    ticks = list(straight_flight(scenario))
    record(RunRecorder(tmp_path / "run.rrd", scenario, "detail", mode="virtual"), scenario, ticks)
    rows: dict[str, list[int]] = {}
    for chunk in RrdReader(tmp_path / "run.rrd").stream():
        if chunk.entity_path in {layout.limit_entity(layout.SEPARATION), layout.LAMBDA2}:
            found = (
                chunk.to_record_batch().column(layout.TICK).to_pylist()
                if not chunk.is_static
                else []
            )
            rows.setdefault(chunk.entity_path, []).extend(found)
    limit = sorted(rows[layout.limit_entity(layout.SEPARATION)])
    assert (limit[0], limit[-1]) == (0, ticks[-1].index)
    assert sorted(rows[layout.LAMBDA2]) == [t.index for t in ticks if t.index % 5 == 0]
