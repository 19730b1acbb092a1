"""Agents that join, leave or may join: shown as what they are, and no others counted."""

import pytest

import worldsim.results
from tests.small_scenario import SMALL
from worldsim.commands.app import command
from worldsim.report.shown import Shown
from worldsim.report.stills import facts

CHANGING = (
    SMALL.replace("agents = 2", "agents = 2\nspare = 1").replace("5.0", "6.0")
    + """
[[event]]
at_s = 1.0
kill = [1]
for_s = 0.5
[[event]]
at_s = 3.0
join = { count = 1, start = { kind = "list", positions_m = [[-2.6, 0, 0]] } }
[[event]]
at_s = 5.0
leave = [0]
[expect]
converge = false
"""
)


@pytest.fixture(scope="module")
def shown(tmp_path_factory: pytest.TempPathFactory) -> Shown:
    """A run of two agents with a spare: one is killed, one joins, one leaves."""
    base = tmp_path_factory.mktemp("run")
    (base / "changing.toml").write_text(CHANGING)
    command(["sim", str(base / "changing.toml"), "--out", str(base / "out")])
    return Shown(worldsim.results.open(base / "out"))


def _agents_told(shown: Shown, time_s: float) -> list[str]:
    return [fact for fact in facts(shown, shown.tick_at(time_s)) if "agents running" in fact]


def test_a_still_counts_those_who_belong_to_the_fleet_by_then(shown: Shown) -> None:
    assert shown.agents == 4  # with the one who joins, and the spare
    assert _agents_told(shown, 0.5) == []
    assert _agents_told(shown, 1.2) == ["1 of 2 agents running"]
    assert _agents_told(shown, 3.5) == ["2 of 3 agents running"]
    assert _agents_told(shown, 4.5) == []
    assert _agents_told(shown, 5.5) == []  # both who are left run
