"""Invariants of the allocation: the time bounds, and what excuses a breach.

tests/judge/test_planted.py plants a breach of each.
"""

from dataclasses import replace

import msgspec
import numpy as np
import pytest

from agent.config import Comms
from agent.messages import Role
from netem.link_parameters import Conditions
from tests.recording.flights import straight_flight, wedge
from worldsim.judge.connectivity import Connectivity, rounds_to_all
from worldsim.judge.finding import InvariantTally
from worldsim.judge.radio_events import ConditionsChanged, Healed, Partitioned
from worldsim.judge.run_events import FormationGiven, RoleChanged, RunEvent, SlowChanged
from worldsim.judge.tick import Tick
from worldsim.judge.verdict import Judge
from worldsim.scenario.tables import Scenario
from worldsim.scenario.target_frame import path_of

AGENTS = 9
DURATION_S = 30.0
HEALED = Healed(t_s=0.0, agent=None, planned=True)


def changed(number: int, change: Conditions) -> ConditionsChanged:
    keys = msgspec.structs.asdict(change)
    return ConditionsChanged(
        t_s=0.0, agent=None, planned=True, number=number, conditions=change, **keys
    )


def flight(agents: int = AGENTS) -> list[Tick]:
    return list(straight_flight(wedge(agents, DURATION_S)))


def judged(ticks: list[Tick], *events: RunEvent) -> dict[str, tuple[int, int]]:
    judge = Judge(wedge(AGENTS, DURATION_S))
    waiting = list(events)
    for tick in ticks:
        while waiting and waiting[0].t_s <= tick.time_s:
            judge.handle_event(waiting.pop(0))
        judge.see(tick)
    return {name: (row.ticks, row.violations) for name, row in judge.invariants().items()}


def claimed(ticks: list[Tick], agent: int, place: tuple[int, int], from_s: float) -> list[Tick]:
    """Return the ticks with another place claimed by an agent from a time on [s]."""
    changed = []
    for tick in ticks:
        places = tick.place.copy()
        if tick.time_s >= from_s:
            places[agent] = place
        changed.append(replace(tick, place=places))
    return changed


@pytest.mark.parametrize(
    ("loss_percent", "horizon_s"), [(0.0, 9.0), (20.0, 23.0), (50.0, 46.0), (80.0, 132.0)]
)
def test_the_settling_time_of_a_team_under_loss(loss_percent: float, horizon_s: float) -> None:
    connectivity = Connectivity(wedge(AGENTS))
    connectivity.handle_event(changed(1, Conditions(loss_percent=loss_percent)))
    settled_s = connectivity.detection_s(2) + 2.0 * connectivity.dissemination_s(AGENTS, 2)
    assert settled_s == pytest.approx(horizon_s, abs=0.6)


def test_without_delivery_the_number_of_rounds_is_infinite() -> None:
    assert rounds_to_all(9, 2, 1.0) == np.inf
    assert rounds_to_all(9, 0, 1.0) == 0


def test_components_follow_range_and_partition() -> None:
    (tick, *_) = flight(4)
    line = replace(tick, position=np.array([[k, 0, 0] for k in (0.0, 1.0, 2.0, 9.0)]))
    connectivity = Connectivity(wedge(4))
    assert connectivity.components(line).members() == [[0, 1, 2, 3]]
    connectivity.handle_event(changed(1, Conditions(range_m=1.5)))
    assert connectivity.components(line).members() == [[0, 1, 2], [3]]
    assert connectivity.components(line).hops == 2
    connectivity.handle_event(
        Partitioned(
            t_s=0.0, agent=None, planned=True, number=2, groups=((1,),), parted="clean", bridge=()
        )
    )
    assert connectivity.components(line).members() == [[0], [1], [2], [3]]
    connectivity.handle_event(HEALED)
    assert connectivity.components(line).hops == 2


def test_a_team_that_flies_straight_to_its_slots_violates_nothing() -> None:
    found = judged(flight())
    assert set(found) == {"I1", "I2", "I3", "I4", "I5", "I6", "I7", "I8"}
    assert {name: broken for name, (_, broken) in found.items() if name not in {"I1"}} == {
        "I2": 0, "I3": 0, "I4": 0, "I5": 0, "I6": 0, "I7": 0, "I8": 0,
    }  # fmt: skip
    assert found["I4"][0] == found["I6"][0] == 601
    assert 300 < found["I7"][0] < found["I2"][0] < 601


def test_a_shared_place_violates_i4_only_after_a_while() -> None:
    ticks = flight()
    there = tuple(ticks[0].place[5].tolist())
    assert judged(claimed(ticks, 4, there, 29.1))["I4"][1] == 0
    assert judged(claimed(ticks, 4, there, 20.0))["I4"][1] > 150


def test_a_step_that_outlasts_a_slow_fault_excuses_a_shared_place() -> None:
    ticks = flight()
    there, back = (tuple(ticks[0].place[agent].tolist()) for agent in (5, 4))
    shared = claimed(claimed(ticks, 4, there, 18.0), 4, back, 25.0)
    slow = SlowChanged(t_s=5.0, agent=4, planned=True, number=0, delay_s=5.0)
    ended = msgspec.structs.replace(slow, t_s=20.5, ends=True)
    assert judged(shared)["I4"][1] > 0
    assert judged(shared, slow, ended)["I4"][1] == 0
    brief = msgspec.structs.replace(ended, delay_s=0.5)
    assert judged(shared, msgspec.structs.replace(slow, delay_s=0.5), brief)["I4"][1] > 0


def test_a_change_of_place_in_a_quiet_team_violates_i7_unless_a_fault_precedes_it() -> None:
    ticks = flight()
    swapped = claimed(
        claimed(ticks, 4, tuple(ticks[0].place[5]), 25.0), 5, tuple(ticks[0].place[4]), 25.0
    )
    assert judged(swapped)["I7"][1] == 1
    assert judged(swapped, msgspec.structs.replace(HEALED, t_s=24.0))["I7"][1] == 0


def test_a_fourth_change_of_role_without_a_fault_violates_i6() -> None:
    roles: tuple[Role, ...] = ("vertex", "member", "vertex", "distress")
    flips = [RoleChanged(t_s=10.0 + k, agent=3, role=role) for k, role in enumerate(roles)]
    assert judged(flight(), *flips[:3])["I6"][1] == 0
    assert judged(flight(), *flips)["I6"][1] == 1
    fault = msgspec.structs.replace(HEALED, t_s=12.5)
    assert judged(flight(), *flips[:3], fault, flips[3])["I6"][1] == 0


def test_faults_of_two_kinds_at_one_time_allow_twice_as_many_changes_of_role() -> None:
    roles: tuple[Role, ...] = ("vertex", "member", "vertex", "distress")
    flips = [RoleChanged(t_s=10.0 + k, agent=3, role=role) for k, role in enumerate(roles)]
    healed = msgspec.structs.replace(HEALED, t_s=9.5)
    radio = ConditionsChanged(t_s=9.5, agent=None, planned=True, number=0, conditions=Conditions())
    assert judged(flight(), healed, *flips)["I6"][1] == 1
    assert judged(flight(), healed, healed, *flips)["I6"][1] == 1
    assert judged(flight(), healed, radio, *flips)["I6"][1] == 0


def test_i6_counts_leads_and_not_who_follows_whom() -> None:
    roles: tuple[Role, ...] = ("distress", "member", "sub-vertex", "member", "vertex", "member")
    following = [RoleChanged(t_s=10.0 + k, agent=3, role=role) for k, role in enumerate(roles)]
    assert judged(flight(), *following)["I6"][1] == 0


def test_agents_have_time_to_act_however_fast_the_radio() -> None:
    """A lone agent claims its first place after 1.5 s, though no news has to travel."""
    fast = msgspec.structs.replace(wedge(1), comms=Comms(multihop_hz=100.0))
    connectivity = Connectivity(fast)
    assert connectivity.dissemination_s(1, 0) == 0.5
    assert connectivity.detection_s(0) == 4.0
    assert "I2" not in judged_until(fast, 4.9)


def judged_until(scenario: Scenario, time_s: float) -> dict[str, InvariantTally]:
    judge = Judge(scenario)
    for tick in straight_flight(scenario):
        if tick.time_s <= time_s:
            judge.see(replace(tick, place=np.full_like(tick.place, -1)))
    return judge.invariants()


def test_a_mission_that_reaches_only_one_part_is_judged_there() -> None:
    """The others still fly the mission before, and claim no place of the new one."""
    scenario = wedge(AGENTS, DURATION_S)
    judge, path = Judge(scenario), path_of(scenario.frame)
    alone = Partitioned(
        t_s=1.0, agent=None, planned=True, number=1, groups=((8,),), parted="clean", bridge=()
    )
    for tick in flight():
        if tick.time_s == 1.0:
            judge.handle_event(alone)
            new = FormationGiven(
                t_s=1.0,
                agent=0,
                planned=True,
                formation="again",
                mission=5,
                path=path,
                tables=scenario.formation,
            )
            judge.handle_event(new)
        mission = tick.mission.copy()
        mission[:8] = 5 if tick.time_s >= 1.0 else 0
        judge.see(replace(tick, mission=mission))
    found = judge.invariants()
    assert found["I2"].ticks > 0
    assert found["I2"].violations == 0


def test_agents_that_come_into_reach_are_one_component_at_once() -> None:
    """Components are found once a second, but agents act on whom they hear meanwhile."""
    scenario = msgspec.structs.replace(wedge(2, 14.0), netem=Conditions(range_m=1.5))
    judge, meet_s = Judge(scenario), 12.3
    for tick in straight_flight(scenario):
        met = tick.time_s >= meet_s
        flown_m = 0.2 * tick.time_s
        position = np.array([[0.0, flown_m - 2.0, 0.0], [-1.0 if met else -4.0, 0.0, 0.0]])
        place = np.array([(0, 0), (0, 1) if met else (0, 0)], dtype=np.int16)
        judge.see(replace(tick, position=position, place=place))
    found = judge.invariants()
    assert found["I2"].ticks > 100
    assert (found["I2"].violations, found["I3"].violations) == (0, 0)
