"""The team's membership: which agents an event selects, and what it does to them."""

from pathlib import Path

import numpy as np
import pytest

from agent.qstructure.formation import Formation
from worldsim.engine.membership import Membership
from worldsim.engine.operations import (
    EndProcesses,
    PauseProcesses,
    ProcessOperation,
    ResumeProcesses,
    StartProcesses,
)
from worldsim.engine.process_life import State
from worldsim.engine.selection import Claims
from worldsim.scenario.faults import Join, Kill, Leave, Pause, ProcessFault, Restart, Resume
from worldsim.scenario.file import load
from worldsim.scenario.start import BoxStart, ListStart
from worldsim.scenario.tables import Scenario
from worldsim.truth.vehicle import Floats

WEDGE = Path("deploy/scenarios/wedge-9.toml")
PLACES = [(0, 0), (0, 1), (1, 1), (1, 2), (2, 1), (3, 1), (0, 2), None, (9, 9), None, None, None]


def scenario(**overrides: str) -> Scenario:
    events = "[{ at_s = 1, join = 3 }]"
    return load(WEDGE, {"event": events, **{k.replace("__", "."): v for k, v in overrides.items()}})


CLAIMS = Claims(PLACES, Formation(scenario().formation, 1.0))
NO_CLAIMS = Claims([None] * 12, CLAIMS.formation)


def positions() -> Floats:
    """Return nine vehicles along a diagonal, and three rows without a vehicle [m; world frame]."""
    position = np.full((12, 3), np.nan)
    position[:9] = np.arange(27).reshape(9, 3)
    return position


def begin(
    members: Membership, number: int, fault: ProcessFault, claims: Claims = CLAIMS
) -> ProcessOperation:
    return members.begin_operation(number, fault, claims, positions(), 0.0)


def killed(members: Membership, *selectors: int | str) -> tuple[int, ...]:
    """Return the agents that a kill would end."""
    operation = begin(members, 0, Kill(selectors))
    assert isinstance(operation, EndProcesses)
    return operation.agents


def states(members: Membership) -> list[State]:
    return [members.state(agent) for agent in range(12)]


@pytest.mark.parametrize(
    ("selectors", "agents"),
    [
        ((3, 1, 3), (1, 3)),
        (("vertex:V1",), (0,)),
        (("queue:Q1", 5), (0, 1, 5, 6)),
        (("all",), tuple(range(9))),
    ],
)
def test_selectors(selectors: tuple[int | str, ...], agents: tuple[int, ...]) -> None:
    assert killed(Membership(scenario()), *selectors) == agents


def test_random_agents_depend_on_the_seed_and_the_event() -> None:
    first = killed(Membership(scenario()), "random:3")
    assert len(set(first)) == 3
    assert killed(Membership(scenario()), "random:3") == first
    others = {killed(Membership(scenario(seed=str(seed))), "random:3") for seed in range(8)}
    assert len(others) > 1


def test_dead_agents_are_not_killed_again_and_restart_with_a_higher_incarnation() -> None:
    members = Membership(scenario())
    members.apply(begin(members, 4, Kill((2, 5))), 10.0)
    assert not members.all_alive
    assert killed(members, 2, 5) == ()
    back = members.end_operation(4, Kill((2, 5)), np.zeros((12, 3)), 20.0)
    assert isinstance(back, StartProcesses)
    assert (back.incarnations, back.poses) == ({2: 1, 5: 1}, {})
    members.apply(back, 20.0)
    assert not members.alive[2]
    assert members.next_boot_s == 21.0
    assert members.admission(20.9).agents == ()
    members.apply(members.admission(21.0), 21.0)
    assert members.alive[[2, 5]].all()
    assert members.incarnations[2] == 1


def test_a_paused_agent_is_alive_but_does_not_step_until_it_resumes() -> None:
    members = Membership(scenario())
    members.apply(begin(members, 0, Pause(("vertex:V1", 4))), 10.0)
    assert members.alive[[0, 4]].all()
    assert not members.running[[0, 4]].any()
    assert members.first_running == 1
    assert killed(members, "vertex:V1") == ()  # a paused agent no longer holds its place
    assert killed(members, 4) == (4,)
    again = begin(members, 0, Pause((4,)))
    assert isinstance(again, PauseProcesses)
    assert again.agents == ()
    members.apply(begin(members, 1, Resume((4,))), 11.0)
    assert members.end_operation(0, Pause((4,)), positions(), 12.0) == ResumeProcesses(0, (0,), ())
    members.apply(begin(members, 2, Kill((0,))), 12.0)
    assert members.end_operation(0, Pause((4,)), positions(), 12.0) is None


def test_joining_agents_get_the_next_ids_and_start_clear_of_present_vehicles() -> None:
    members = Membership(scenario())
    start = BoxStart(size_m=(3.0, 3.0, 3.0), spacing_m=0.6)
    joining = begin(members, 0, Join(count=3, start=start))
    assert isinstance(joining, StartProcesses)
    assert list(joining.incarnations) == [9, 10, 11]
    joined = np.array([pose.position for pose in joining.poses.values()])
    all_positions = np.concatenate((positions()[:9], joined))
    apart = np.linalg.norm(all_positions[:, None] - joined, axis=2)
    apart[range(9, 12), range(3)] = np.inf
    assert apart.min() >= 0.6


def test_a_listed_position_that_is_occupied_refuses_the_whole_join() -> None:
    members = Membership(scenario())
    start = ListStart(positions_m=((50.0, 0.0, 0.0), (0.1, 1.0, 2.0)))
    refused = begin(members, 0, Join(count=2, start=start))
    assert isinstance(refused, StartProcesses)
    assert refused.incarnations == {}
    assert refused.refused == "a vehicle is within 0.25 m of [0.1, 1, 2]"


def test_an_agent_that_left_restarts_clear_of_present_vehicles() -> None:
    members = Membership(scenario())
    members.apply(begin(members, 4, Leave((2,)), NO_CLAIMS), 10.0)
    assert members.state(2) is State.GONE
    position = np.zeros((12, 3)) + np.arange(12)[:, None]
    position[2] = np.nan
    back = members.begin_operation(7, Restart((2,)), NO_CLAIMS, position, 11.0)
    assert isinstance(back, StartProcesses)
    where = back.poses[2].position
    away = np.linalg.norm(np.delete(position, 2, axis=0) - where, axis=1)
    assert away.min() >= 0.6


def test_sabotage_takes_hold_of_an_agent_that_is_dead_when_it_begins() -> None:
    """The medium leaves its radio off until the agent is back."""
    members = Membership(scenario())
    members.apply(begin(members, 0, Kill((0,))), 0.0)
    assert members.victims(1, (0, 3), CLAIMS) == (0, 3)
