"""Faults of single agents in the timeline: which are valid."""

from pathlib import Path

import pytest

from worldsim.scenario.file import load
from worldsim.scenario.toml import ScenarioError

WEDGE = Path("deploy/scenarios/wedge-9.toml")


@pytest.mark.parametrize(
    ("fault", "key", "detail"),
    [
        ("clock = { offset_s = 1 }", "clock.agents", "is missing"),
        ("clock = { agents = [9], offset_s = 1 }", "clock.agents[0]", "no agent 9; 0 to 8"),
        ("clock = { agents = [1] }", "clock.offset_s", "the clock would be right"),
        ("clock = { agents = [1], offset_s = -2 }", "clock.offset_s", "less than 0 s"),
        ("clock = { agents = [1], offset_s = 1e9 }", "clock.offset_s", "86400"),
        ("clock = { agents = [1], drift_ppm = 1e6 }", "clock.drift_ppm", "10000"),
    ],
)
def test_an_invalid_fault_is_rejected(fault: str, key: str, detail: str) -> None:
    with pytest.raises(ScenarioError) as caught:
        load(WEDGE, {"event": f"[{{ at_s = 1, {fault} }}]"})
    assert str(caught.value).startswith(f"{WEDGE}: event[0].{key}: ")
    assert detail in str(caught.value)
