"""The rows of ``tests.fault_rows``: each is a valid scenario, and a flight becomes a line."""

from typing import Any

import pytest

from tests.fault_rows import ROWS, Row, line_of, scenario_of


@pytest.mark.parametrize("row", ROWS, ids=lambda row: row.name)
def test_each_row_is_a_scenario_with_its_bound_and_time_to_meet_it(row: Row) -> None:
    scenario = scenario_of(row, 7)
    assert (scenario.seed, scenario.expect.reform_within_s) == (7, row.within_s)
    ends_s = [
        event.at_s + (event.for_s or 0.0)
        for event in scenario.event
        if event.kind not in {"sabotage", "intruder"}  # they excuse nothing
    ]
    assert max(ends_s, default=0.0) + row.within_s <= scenario.duration_s
    assert all(event.is_fault or event.join for event in scenario.event)


def summary(outcome: str, reformed_s: float | None, agents: list[int]) -> dict[str, Any]:
    return {
        "outcome": outcome,
        "reason": None if outcome == "pass" else "not re-formed",
        "recoveries": [{"reformed_s": reformed_s}],
        "min_separation_m": 0.31234,
        "faults": [{"kind": "kill", "agents": agents, "frames": None}],
    }


def test_a_line_tells_passes_the_worst_time_and_what_was_struck() -> None:
    good = [summary("pass", 2.5, [3]), summary("pass", 4.25, [1])]
    cells = "a row | 2 of 2 | 10 s | 4.2 s | 0.312 m | kill: agents"
    assert line_of(Row("a row", (), 10.0), good) == (f"| {cells} |", True)


def test_a_line_tells_why_a_flight_did_not_pass() -> None:
    line, good = line_of(Row("a row", (), 10.0), [summary("fail", None, [])])
    assert not good
    assert line.endswith("| never | 0.312 m | kill: nothing | not re-formed")
