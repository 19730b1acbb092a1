"""Knowledge comes by radio: who is not briefed flies no mission before it has heard one.

Until then it keeps pace with the frame that comes down the tiers.
"""

from itertools import chain

import numpy as np
import pytest
from numpy.typing import NDArray

from agent.messages import DISTRESS, NO_MISSION
from agent.qstructure.frame_path import Track
from tests.closed_loop.test_faults import BAD, TickList, check_safety, scenario, violated
from tests.closed_loop.test_roles import line
from worldsim.engine.virtual import Flight, fly
from worldsim.judge.tick import Tick
from worldsim.scenario.tables import Scenario
from worldsim.scenario.target_frame import path_of

CLEAN: dict[str, str] = {}
MOVES = {"frame": "{ waypoints_m = [[0, 0, 0], [9, 0, 0]], speed_mps = 0.2, start_s = 2 }"}
APART = "join = { count = 1, start = { kind = 'list', positions_m = [[-3, 3, 0]] } }"
JOINER = 9
STRAIGHT = "{ waypoints_m = [[0, 0, 0], [9, 0, 0]], speed_mps = 0.3, start_s = 4 }"
TURNING = (
    "{ waypoints_m = [[0, 0, 0], [4, 0, 0], [4, 4, 0]], speed_mps = 0.3, start_s = 4,"
    " yaw = 'path', turn_dps = 4 }"
)
ONLY_THE_FRAME = {"fleet.briefed": "[0]", "comms.multihop_hz": "0"}
WITHOUT_TIERS = {"control.controller": "tests.closed_loop.ablated:WithoutTiers"}
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


def moved_in_frame(flown: Scenario, ticks: list[Tick], from_s: float) -> NDArray[np.float64]:
    """Return how far each agent's vehicle moves in the moving frame from a time on [m]."""
    track = Track(path_of(flown.frame))
    later = [tick for tick in ticks if tick.time_s >= from_s]
    points = np.array(
        [[track.at(tick.time_s).to_frame(tuple(at)) for at in tick.position] for tick in later]
    )
    moved: NDArray[np.float64] = np.linalg.norm(points - points[0], axis=2).max(axis=0)
    return moved


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


def test_a_joiner_that_hears_nothing_stays_where_it_joined() -> None:
    expected = {"expect.reform_within_s": "20"}
    flown = scenario(1, 30, f"at_s = 1, {APART}", **deaf_and_mute(JOINER), **MOVES, **expected)
    flight, ticks = recorded(flown)
    assert moved_m(ticks, JOINER) <= 0.1
    assert moved_m(ticks, 0) > 3.0
    assert {int(tick.mission[JOINER]) for tick in ticks} == {NO_MISSION}
    assert {tuple(tick.place[JOINER].tolist()) for tick in ticks} == {(-1, -1)}
    (phase,), (joined,) = flight.loop.judge.phases, flight.loop.judge.recoveries
    assert (phase.converge_s, phase.residual_m, joined.reformed_s) == (None, None, None)
    missed = flight.loop.judge.shortcomings().missed
    assert missed == ["converge pyramidal-wedge", "reform_within_s"]


@pytest.mark.parametrize("path", [STRAIGHT, TURNING], ids=["straight", "turning"])
def test_without_the_mission_agents_keep_their_place_beside_the_team(path: str) -> None:
    flown = scenario(1, 28, frame=path, **ONLY_THE_FRAME)
    _, ticks = recorded(flown)
    assert moved_in_frame(flown, ticks, from_s=4.0)[1:].max() < 0.5
    last = ticks[-1]
    assert last.mission.tolist() == [0] + [NO_MISSION] * 8
    assert last.place[1:].tolist() == [[-1, -1]] * 8
    assert last.hierarchy.role[1:].tolist() == [DISTRESS] * 8


@pytest.mark.pure
def test_without_tiers_the_team_leaves_them_behind() -> None:
    flown = scenario(1, 24, frame=STRAIGHT, **ONLY_THE_FRAME, **WITHOUT_TIERS)
    _, ticks = recorded(flown)
    assert moved_in_frame(flown, ticks, from_s=4.0)[1:].min() > 5.0


def test_a_joiner_behind_a_moving_team_keeps_up_until_the_mission_reaches_it() -> None:
    """The multihop channel fails for as long as a joiner that hovers needs to be out of range."""
    outage = "at_s = 9, netem = { multihop = { loss_percent = 100 } }, for_s = 13"
    join = "at_s = 9, join = { count = 1, start = { kind = 'list', positions_m = [[-4, 0, 0]] } }"
    path = "{ waypoints_m = [[0, 0, 0], [4.5, 0, 0]], speed_mps = 0.3, start_s = 10 }"
    radio = {"netem.range_m": "4", "netem.loss_percent": "50"}
    flight, ticks = recorded(scenario(1, 34, outage, join, frame=path, **radio))
    assert 22.0 <= learned_s(ticks, JOINER) <= 24.0
    (joined,) = [each for each in flight.loop.judge.recoveries if each.kind == "join"]
    assert joined.reformed_s is not None


@pytest.mark.parametrize("start_s", [4, 1000], ids=["moving", "at rest"])
def test_without_the_mission_an_agent_gives_up_the_point_that_a_member_needs(start_s: int) -> None:
    path = f"{{ waypoints_m = [[0, 0, 0], [9, 0, 0]], speed_mps = 0.3, start_s = {start_s} }}"
    fleet = line([2.0, 0.0], 6.0, frame=path, **ONLY_THE_FRAME)
    while fleet.loop.world.time_s < 16.0:
        fleet.slot()
    assert fleet.loop.figures.slot_error[0] < 0.05
    apart = fleet.loop.world.vehicles.position[1] - fleet.loop.world.vehicles.position[0]
    assert 0.25 < np.linalg.norm(apart) < 1.0


@pytest.mark.pure
def test_in_distress_with_a_mission_an_agent_keeps_to_its_frame_and_claims_nothing() -> None:
    flown = scenario(1, 20, frame=STRAIGHT, **WITHOUT_TIERS)
    _, ticks = recorded(flown)
    distressed = ticks[-1].hierarchy.role == DISTRESS
    assert distressed.sum() == 8
    claims = [tick.place[distressed].tolist() for tick in ticks]
    assert all(claim == [[-1, -1]] * 8 for claim in claims)
    assert moved_in_frame(flown, ticks, from_s=14.0)[distressed].max() < 0.3


def test_an_operators_mission_reaches_a_team_of_which_nobody_was_briefed() -> None:
    given = "at_s = 5, formation = '../formations/pyramidal-wedge.toml'"
    flight, ticks = recorded(scenario(1, 25, given, **{"fleet.briefed": "[]"}))
    assert all(moved_m([t for t in ticks if t.time_s < 5.0], agent) < 0.1 for agent in range(9))
    before, after = flight.loop.judge.phases
    assert before.converge_s is None
    assert after.converge_s is not None
    assert violated(flight) == []
