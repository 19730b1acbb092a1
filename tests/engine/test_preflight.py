"""Checks before a run starts: room for those who join, found in bounded work."""

from time import process_time

import pytest

from tests.small_scenario import SMALL
from worldsim.engine.preflight import VIRTUAL_COMMAND_TICKS, admit
from worldsim.scenario.file import parse
from worldsim.scenario.toml import ScenarioError

FULL = "{ kind = 'box', size_m = [0.1, 0.1, 0.1], spacing_m = 0.6 }"
CROWDED = "{ kind = 'box', size_m = [5, 5, 5], spacing_m = 0.6 }"


def test_a_join_that_never_has_room_is_refused_by_its_key() -> None:
    event = f"[{{ at_s = 1, join = {{ count = 3, start = {FULL} }} }}]"
    with pytest.raises(ScenarioError, match="no room for 3 agents") as refused:
        admit(parse(SMALL, overrides={"event": event}), "small.toml", VIRTUAL_COMMAND_TICKS)
    assert refused.value.key == "event[0].join.start"


def test_a_crowded_box_is_refused_in_bounded_work() -> None:
    scenario = parse(SMALL, overrides={"fleet.agents": "1000", "fleet.start": CROWDED})
    began = process_time()
    with pytest.raises(ScenarioError, match="no room for 1000 agents"):
        admit(scenario, "small.toml", VIRTUAL_COMMAND_TICKS)
    assert process_time() - began < 5.0


def test_a_timeline_that_asks_for_too_many_formations_is_refused() -> None:
    event = ", ".join(f"{{ at_s = {1 + k / 1000}, join = 1 }}" for k in range(500))
    overrides = {"event": f"[{event}]", "fleet.agents": "500", "fleet.start": "{ kind = 'box' }"}
    with pytest.raises(ScenarioError, match="500 events change what 1000 agents form"):
        parse(SMALL, overrides=overrides)
