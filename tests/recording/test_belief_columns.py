"""What agents believe of their neighbours, beside the truth."""

from dataclasses import replace

import numpy as np
import pytest

from tests.recording.flights import straight_flight, wedge
from worldsim.judge.tick import Tick
from worldsim.recording import layout
from worldsim.recording.belief_columns import LINES_MAX, BeliefColumns
from worldsim.scenario.tables import SLOTS_PER_TICK

AGENTS = 3


def tick(index: int, x: float = 0.0) -> Tick:
    """Agents at x, x + 1 and x + 2 m."""
    first = next(straight_flight(wedge(AGENTS, duration_s=0.1)))
    places = np.array([[x + agent, 0.0, 0.0] for agent in range(AGENTS)])
    return replace(first, index=index, time_s=index / 20, position=places)


def drawn(columns: BeliefColumns, ticks: list[Tick], entity: str) -> list[list[object]]:
    return [
        row
        for block in columns.blocks(ticks)
        if block.entity == entity
        for column in block.columns
        for row in column.as_arrow_array().to_pylist()
    ]


def test_a_line_leads_from_the_truth_to_what_is_believed() -> None:
    columns = BeliefColumns(AGENTS)
    columns.keep(0, 0, ((1, (1.0, 0.5, 0.0)), (2, (2.0, 0.0, 0.01))))
    (lines,) = drawn(columns, [tick(0)], layout.BELIEFS)
    assert lines == [[[1.0, 0.0, 0.0], [1.0, 0.5, 0.0]]], "who is right to a centimetre has none"


def test_each_agent_has_the_error_of_its_worst_belief() -> None:
    columns = BeliefColumns(AGENTS)
    columns.keep(0, 0, ((1, (1.0, 0.5, 0.0)), (2, (2.0, 0.0, 0.01))))
    columns.keep(2, 0, ((0, (0.0, 0.0, -3.0)),))
    (errors,) = drawn(columns, [tick(0)], layout.BELIEF_ERROR)
    assert errors == pytest.approx([0.5, np.nan, 3.0], nan_ok=True)


def test_the_truth_is_that_of_the_slot_between_two_ticks() -> None:
    columns = BeliefColumns(AGENTS)
    half = SLOTS_PER_TICK // 2
    columns.keep(0, SLOTS_PER_TICK + half, ((1, (1.2, 0.0, 0.0)),))
    (errors,) = drawn(columns, [tick(1), tick(2, x=0.4)], layout.BELIEF_ERROR)
    assert errors[0] == pytest.approx(0.0, abs=0.02)


def test_lines_end_once_all_are_right() -> None:
    columns = BeliefColumns(AGENTS)
    columns.keep(0, 0, ((1, (1.0, 0.5, 0.0)),))
    assert len(drawn(columns, [tick(0)], layout.BELIEFS)[0]) == 1
    columns.keep(0, SLOTS_PER_TICK, ((1, (1.0, 0.0, 0.0)),))
    assert drawn(columns, [tick(1)], layout.BELIEFS) == [[]]
    columns.keep(0, 2 * SLOTS_PER_TICK, ((1, (1.0, 0.0, 0.0)),))
    assert drawn(columns, [tick(2)], layout.BELIEFS) == []


def test_a_flood_of_wrong_beliefs_is_drawn_in_part_and_unknown_agents_not_at_all() -> None:
    columns = BeliefColumns(AGENTS)
    columns.keep(0, 0, (*[(1, (9.0, k, 0.0)) for k in range(LINES_MAX + 50)], (77, (0, 0, 0))))
    (lines,) = drawn(columns, [tick(0)], layout.BELIEFS)
    assert len(lines) == LINES_MAX
