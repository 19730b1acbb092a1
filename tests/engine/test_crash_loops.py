"""A crash loop: agents have a place soon after each restart, and the check by hand sees it."""

from pathlib import Path

import pytest

from tests.restart_cycles import RETURN_WITHIN_S, flown_s, scenario, without_place
from worldsim.engine.virtual import fly
from worldsim.judge.run_events import Killed, Restarted, SlotChanged
from worldsim.scenario.file import load

CYCLES = 12
END_S = 100.0
RESTART = {"kind": "restart", "agent": 3, "t_s": 50.0}
SLOT = {"kind": "slot", "agent": 3, "t_s": 55.0, "place": (0, 1)}
NO_SLOT = {**SLOT, "place": None}
KILL = {"kind": "kill", "agent": 3, "t_s": 60.0}
MISSING = [f"agent 3 has no place {RETURN_WITHIN_S:g} s after 50.0 s"]


@pytest.mark.parametrize(
    ("found", "missing"),
    [
        ([RESTART, SLOT], []),
        ([RESTART], MISSING),
        ([RESTART, NO_SLOT], MISSING),
        ([RESTART, {**SLOT, "agent": 4}], MISSING),
        ([RESTART, {**SLOT, "t_s": 45.0}], MISSING),
        ([RESTART, {**SLOT, "t_s": 50.0 + RETURN_WITHIN_S + 1.0}], MISSING),
        ([{**RESTART, "t_s": END_S - RETURN_WITHIN_S + 1.0}], []),
        ([RESTART, KILL], []),
        ([RESTART, {**KILL, "agent": 4}], MISSING),
        ([RESTART, {**KILL, "t_s": 75.0}, {**SLOT, "t_s": 80.0}], MISSING),
        ([{**RESTART, "agent": None}, {**KILL, "agent": None}], []),
    ],
)
def test_a_restart_needs_a_place_in_time_where_there_is_time(
    found: list[dict[str, object]], missing: list[str]
) -> None:
    assert without_place(found, END_S) == missing


@pytest.mark.parametrize("loss_percent", [0, 50])
def test_each_agent_has_a_place_after_its_restart_though_others_die_each_second(
    loss_percent: int, tmp_path: Path
) -> None:
    file = tmp_path / "restarts.toml"
    file.write_text(scenario(1.0, CYCLES), "utf-8")
    flight = fly(load(file, {"netem.loss_percent": str(loss_percent)}))
    found = [
        {"kind": kind, "agent": event.agent, "t_s": event.t_s, "place": getattr(event, "place", 0)}
        for event in flight.loop.events
        for kind, cls in (("kill", Killed), ("restart", Restarted), ("slot", SlotChanged))
        if isinstance(event, cls)
    ]
    assert sum(each["kind"] == "restart" for each in found) >= CYCLES
    assert without_place(found, flown_s(1.0, CYCLES)) == []
