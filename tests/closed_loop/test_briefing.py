"""Knowledge comes by radio: who is not briefed flies no mission before it has heard one."""

from itertools import chain

import numpy as np
import pytest

from agent.messages import NO_MISSION
from tests.closed_loop.test_faults import BAD, TickList, check_safety, scenario, violated
from worldsim.engine.virtual import Flight, fly
from worldsim.judge.tick import Tick
from worldsim.scenario.tables import Scenario

CLEAN: dict[str, str] = {}
MOVES = {"frame": "{ waypoints_m = [[0, 0, 0], [9, 0, 0]], speed_mps = 0.2, start_s = 2 }"}
APART = "join = { count = 1, start = { kind = 'list', positions_m = [[-3, 3, 0]] } }"
JOINER = 9
BOOTED_S = 16.0
"""When an agent that joins at 15 s steps first [s]."""


def deaf_and_mute(agent: int, others: int = 9) -> dict[str, str]:
    """Return links by which an agent hears nobody, and nobody hears it."""
    pairs = chain.from_iterable(((each, agent), (agent, each)) for each in range(others))
    lost = [f"{{ from = {a}, to = {b}, loss_percent = 100 }}" for a, b in pairs if a != b]
    return {"netem.link": f"[{', '.join(lost)}]"}


def recorded(flown: Scenario) -> tuple[Flight, list[Tick]]:
    recorder = TickList()
    flight = fly(flown, recorder)
    check_safety(flight)
    return flight, recorder.ticks


def learned_s(ticks: list[Tick], agent: int) -> float:
    """Return when an agent knows a mission first [s]."""
    return min(tick.time_s for tick in ticks if tick.mission[agent] != NO_MISSION)


def moved_m(ticks: list[Tick], agent: int) -> float:
    """Return how far an agent's vehicle ever is from where it came into the world [m]."""
    path = np.array([tick.position[agent] for tick in ticks])
    path = path[~np.isnan(path[:, 0])]
    return float(np.linalg.norm(path - path[0], axis=1).max())


@pytest.mark.parametrize(("radio", "within_s"), [(CLEAN, 1.5), (BAD, 5.0)], ids=["clean", "bad"])
def test_a_joiner_hears_the_mission_and_takes_its_place(
    radio: dict[str, str], within_s: float
) -> None:
    flight, ticks = recorded(scenario(1, 35, "at_s = 15, join = 1", **radio))
    assert BOOTED_S <= learned_s(ticks, JOINER) <= BOOTED_S + within_s
    (joined,) = flight.loop.judge.recoveries
    assert joined.reformed_s is not None
    assert joined.reformed_s <= 10.0


@pytest.mark.parametrize("radio", [CLEAN, BAD], ids=["clean", "bad"])
def test_one_briefed_agent_is_enough(radio: dict[str, str]) -> None:
    flight, ticks = recorded(scenario(1, 20, **{"fleet.briefed": "[0]"}, **radio))
    assert ticks[1].mission.tolist() == [0] + [NO_MISSION] * 8
    assert all(learned_s(ticks, agent) <= 5.0 for agent in range(9))
    converge_s = flight.loop.judge.phases[0].converge_s
    assert converge_s is not None
    assert converge_s <= 12.0
    assert flight.rejected == 0


def test_an_agent_that_restarts_alone_knows_nothing_of_the_mission_it_flew() -> None:
    restart = "at_s = 10, kill = [3], for_s = 1"
    _, ticks = recorded(scenario(1, 15, restart, **deaf_and_mute(3)))
    flown = {int(tick.mission[3]) for tick in ticks if tick.time_s > 12.5}
    assert {int(tick.mission[3]) for tick in ticks if 0.1 < tick.time_s < 9.0} == {0}
    assert flown == {NO_MISSION}


@pytest.mark.parametrize(
    "radio", [deaf_and_mute(JOINER), {"comms.multihop_hz": "0"}], ids=["100 % loss", "multihop off"]
)
def test_a_joiner_that_cannot_hear_the_mission_stays_where_it_joined(
    radio: dict[str, str],
) -> None:
    expected = {"expect.reform_within_s": "20"}
    flown = scenario(1, 30, f"at_s = 1, {APART}", **radio, **MOVES, **expected)
    flight, ticks = recorded(flown)
    assert moved_m(ticks, JOINER) <= 0.1
    assert moved_m(ticks, 0) > 3.0
    assert {int(tick.mission[JOINER]) for tick in ticks} == {NO_MISSION}
    assert {tuple(tick.place[JOINER].tolist()) for tick in ticks} == {(-1, -1)}
    (phase,), (joined,) = flight.loop.judge.phases, flight.loop.judge.recoveries
    assert (phase.converge_s, phase.residual_m, joined.reformed_s) == (None, None, None)
    missed = flight.loop.judge.shortcomings().missed
    assert missed == ["converge pyramidal-wedge", "reform_within_s"]


def test_an_operators_mission_reaches_a_team_of_which_nobody_was_briefed() -> None:
    given = "at_s = 5, formation = '../formations/pyramidal-wedge.toml'"
    flight, ticks = recorded(scenario(1, 25, given, **{"fleet.briefed": "[]"}))
    assert all(moved_m([t for t in ticks if t.time_s < 5.0], agent) < 0.1 for agent in range(9))
    before, after = flight.loop.judge.phases
    assert before.converge_s is None
    assert after.converge_s is not None
    assert violated(flight) == []
