"""The newest mission is given until a running agent flies it, and again when no one flies it."""

import pytest

from agent.comms.mission import KEYS_PER_VERSION
from agent.messages import NO_MISSION
from tests.scenario.test_timeline import LINE, scenario
from worldsim.engine.virtual import VirtualFleet

GIVEN = f"at_s = 2\nformation = {LINE}"
MISSION = KEYS_PER_VERSION
APART = "partition = [[0, 1], [2, 3]]\nfor_s = 5"


def missions(time_s: float, *events: str) -> list[int]:
    """Return the key of the mission that each agent of a fleet of four flies at a time [s]."""
    fleet = VirtualFleet(scenario(*events))
    while fleet.loop.world.time_s < time_s:
        fleet.slot()
    return [command.telemetry.mission for command in fleet.loop.world.latest if command is not None]


@pytest.mark.parametrize(
    "restart",
    [
        ["at_s = 4\nkill = ['all']\nfor_s = 1"],
        ["at_s = 4\nkill = ['all']", "at_s = 5\nrestart = [2]", "at_s = 8\nrestart = [0, 1, 3]"],
        ["at_s = 4\nleave = ['all']\nfor_s = 1"],
    ],
)
def test_a_restart_of_everybody_does_not_lose_the_mission(restart: list[str]) -> None:
    assert missions(12.0, GIVEN, *restart) == [MISSION] * 4


def test_the_newest_of_two_missions_is_given_again() -> None:
    second = f"at_s = 3\nformation = {LINE}"
    assert missions(9.0, GIVEN, second, "at_s = 4\nkill = ['all']\nfor_s = 1") == [2 * MISSION] * 4


def test_a_mission_is_not_lost_with_the_agent_that_could_not_pass_it_on() -> None:
    alone = "at_s = 1\npartition = [[0], [1, 2, 3]]"
    assert missions(3.0, alone, GIVEN) == [MISSION, 0, 0, 0]
    assert missions(5.0, alone, GIVEN, "at_s = 3\nkill = [0]")[1:] == [MISSION] * 3


def test_a_mission_spreads_by_radio_only_as_long_as_any_agent_flies_it() -> None:
    events = (GIVEN, f"at_s = 4\n{APART}", "at_s = 5\nkill = [2, 3]\nfor_s = 1")
    assert missions(8.5, *events) == [MISSION, MISSION, NO_MISSION, NO_MISSION]
    assert missions(12.0, *events) == [MISSION] * 4


def test_what_nobody_knows_any_more_and_no_operator_gave_is_not_given() -> None:
    assert missions(8.0, "at_s = 4\nkill = ['all']\nfor_s = 1") == [NO_MISSION] * 4
