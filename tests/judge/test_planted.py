"""A planted violation of each invariant and each expectation is found, at the very tick.

Nine agents fly straight to their slots and stay there. A row plants one thing into the truth or the
events; the judge must find it at the row's time, not before, and nothing but what the row lists.
The same flight without it violates nothing: a judge that is blind fails, or one that sees ghosts.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from functools import cache
from typing import NamedTuple

import msgspec
import numpy as np
import pytest

from agent.messages import Role
from agent.qstructure.orientation import OrientationSpec
from netem.link_parameters import Conditions
from tests.recording.flights import straight_flight, wedge
from worldsim.judge.run_events import Killed, RoleChanged, RunEvent
from worldsim.judge.tick import Tick
from worldsim.judge.verdict import Judge
from worldsim.results.outcome import INVARIANT_WORDS
from worldsim.scenario.obstacle_tables import Sphere
from worldsim.scenario.tables import Expectations, Scenario

AGENTS, DURATION_S, AT_S = 9, 20.0, 15.0
ASIDE_M = np.array([0.0, 0.0, 1.0])
_WEDGE = wedge(AGENTS, DURATION_S)
_FREE_YAW = OrientationSpec(yaw_deg=0.0)
SCENARIO: Scenario = msgspec.structs.replace(
    _WEDGE,
    formation=msgspec.structs.replace(
        _WEDGE.formation,
        queue=tuple(
            msgspec.structs.replace(queue, orientation=_FREE_YAW)
            for queue in _WEDGE.formation.queue
        ),
    ),
    seed=2,  # whose ways to the slots do not cross
    netem=Conditions(range_m=6.0),
    obstacle=(Sphere(centre_m=(9.0, 0.0, 0.0), radius_m=0.5),),
    expect=Expectations(
        converge_within_s=9.0,
        reform_within_s=3.0,
        in_formation_fraction=0.9,
        max_slot_error_m=0.5,
        min_lambda2=5.0,
        min_separation_m=0.4,
        min_obstacle_distance_m=2.0,
        attitude_within_deg=10.0,
    ),
)
Plant = Callable[[Tick], Tick]


def moved(agent: int, by_m: Sequence[float], from_s: float = AT_S) -> Plant:
    """Return a plant that moves a vehicle [m] from a time on."""

    def plant(tick: Tick) -> Tick:
        position = tick.position.copy()
        position[agent] += np.array(by_m) * (tick.time_s >= from_s)
        return replace(tick, position=position)

    return plant


def beside(agent: int, other: int, away_m: float) -> Plant:
    """Return a plant that puts a vehicle so far from another one [m]."""

    def plant(tick: Tick) -> Tick:
        position = tick.position.copy()
        if tick.time_s >= AT_S:
            position[agent] = position[other] + away_m * ASIDE_M
        return replace(tick, position=position)

    return plant


def placed(agent: int, xyz: Sequence[float]) -> Plant:
    """Return a plant that puts a vehicle at a point [m; world frame]."""

    def plant(tick: Tick) -> Tick:
        position = tick.position.copy()
        if tick.time_s >= AT_S:
            position[agent] = xyz
        return replace(tick, position=position)

    return plant


def claimed(*claims: tuple[int, tuple[int, int]]) -> Plant:
    """Return a plant by which agents claim other places."""

    def plant(tick: Tick) -> Tick:
        place = tick.place.copy()
        for agent, other in claims if tick.time_s >= AT_S else ():
            place[agent] = other
        return replace(tick, place=place)

    return plant


def flown_mission(tick: Tick) -> Tick:
    """Let an agent go back to an older mission."""
    mission = tick.mission.copy()
    mission[2] = 0 if tick.time_s < AT_S else -1
    return replace(tick, mission=mission)


def packet_lost(tick: Tick) -> Tick:
    """Let a frame vanish without a cause."""
    lost = {**tick.packets, "delivered": tick.packets["delivered"] - (tick.time_s >= AT_S)}
    return replace(tick, packets=lost)


def turned(tick: Tick) -> Tick:
    """Let an agent turn away."""
    attitude = tick.attitude.copy()
    attitude[3, 0] += np.float32(0.2 * (tick.time_s >= AT_S))
    return replace(tick, attitude=attitude)


def nothing(tick: Tick) -> Tick:
    return tick


def roles() -> list[RunEvent]:
    """Return four changes of an agent's lead; the last comes when it is planted."""
    flips: tuple[Role, ...] = ("vertex", "member", "vertex", "distress")
    return [RoleChanged(t_s=AT_S - 3.0 + k, agent=3, role=role) for k, role in enumerate(flips)]


@cache
def flight() -> tuple[Tick, ...]:
    level = np.zeros((AGENTS, 3), dtype=np.float32)
    return tuple(replace(tick, attitude=level) for tick in straight_flight(SCENARIO))


def unmet(judge: Judge) -> set[str]:
    """Return the invariants that are violated, and the expectations that are not met."""
    found = judge.invariants()
    broken = {name for name, tally in found.items() if tally.violations}
    return broken | {row.name for row in judge.expectations() if row.held is False}


def first_found(plant: Plant, events: Iterable[RunEvent] = ()) -> dict[str, float]:
    """Return when the judge finds what first [s], asked at each tick."""
    judge, waiting, found = Judge(SCENARIO), list(events), dict[str, float]()
    for tick in flight():
        while waiting and waiting[0].t_s <= tick.time_s:
            judge.handle_event(waiting.pop(0))
        judge.see(plant(tick))
        for name in unmet(judge):
            found.setdefault(name, tick.time_s)
    assert judge.ticks == len(flight())
    return found


class Row(NamedTuple):
    """A planted violation, and all that the judge must find of it: when first [s], by name."""

    found: dict[str, float]
    plant: Plant = nothing
    events: tuple[RunEvent, ...] = ()


CONVERGE_S = 3.3
OUT_S = AT_S + 1.05
"""The team has stood for 2 s at 5.3 s, and is in its slots at 194 ticks before AT_S. At the 22nd
tick out of them it has been there for less than 0.9 of the time."""
OUT = {"max_slot_error_m": AT_S, "in_formation_fraction": OUT_S}
"""What a team violates besides that leaves its slots, or claims others."""
FAR = OUT | {"min_lambda2": AT_S}
ROWS = {
    "I1, vehicles": Row({"I1": AT_S, "min_separation_m": AT_S} | OUT, beside(4, 5, 0.2)),
    "I1, obstacle": Row(
        {"I1": AT_S, "min_obstacle_distance_m": AT_S} | FAR, placed(4, (9.0, 0.0, 0.7))
    ),
    "I2": Row({"I2": AT_S, "I7": AT_S} | OUT, claimed((0, (0, 3)))),
    "I3": Row({"I3": AT_S, "I7": AT_S} | OUT, claimed((4, (0, 3)), (8, (0, 4)))),
    # After 2B: one second.
    "I4": Row({"I4": AT_S + 1.05, "I7": AT_S} | OUT, claimed((4, (0, 2)))),
    "I5": Row({"I5": AT_S, "I7": AT_S} | OUT, flown_mission),
    "I6": Row({"I6": AT_S}, events=tuple(roles())),
    "I7": Row({"I7": AT_S} | OUT, claimed((4, (0, 2)), (5, (3, 1)))),
    "I8": Row({"I8": AT_S}, packet_lost),
    "min_separation_m": Row({"min_separation_m": AT_S} | OUT, beside(4, 5, 0.3)),
    "min_obstacle_distance_m": Row(
        # It is the bound of I1 too.
        {"min_obstacle_distance_m": AT_S, "I1": AT_S} | FAR,
        placed(4, (9.0, 0.0, 2.0)),
    ),
    "converge_within_s": Row({"converge wedge": 9.0}, moved(0, (0.0, 0.0, 1.0), 0.0)),
    "reform_within_s": Row(
        # The 3 s after the loss do not count: 134 ticks before it, and the 15th out of place.
        {"reform_within_s": AT_S, "in_formation_fraction": AT_S + 0.7},
        moved(8, (0.0, 0.0, 0.3), AT_S - 3.0),
        (Killed(t_s=AT_S - 3.0, agent=8, planned=True),),
    ),
    "in_formation_fraction": Row({"in_formation_fraction": OUT_S}, moved(0, (0.0, 0.0, 0.3))),
    "max_slot_error_m": Row(OUT, moved(0, (0.0, 0.0, 0.6))),
    "min_lambda2": Row(FAR, moved(0, (0.0, 0.0, 40.0))),
    "attitude_within_deg": Row({"attitude_within_deg": AT_S}, turned),
}
NO_MEASURE = {"converge", "idle_faults", "property"}
"""Others test the last two: tests/results/test_fault_rows.py and tests/judge/test_properties.py."""


@pytest.mark.parametrize("name", ROWS)
def test_a_planted_violation_is_found_at_its_tick_and_nothing_else(name: str) -> None:
    row = ROWS[name]
    assert first_found(row.plant, row.events) == row.found


def test_without_a_plant_nothing_is_found() -> None:
    assert first_found(nothing) == {}
    judge = Judge(SCENARIO)
    for tick in flight():
        judge.see(tick)
    assert judge.phases[0].converge_s == CONVERGE_S
    assert all(row.held for row in judge.expectations())


def test_each_invariant_and_each_expectation_is_planted() -> None:
    expected = set(Expectations.__struct_fields__) - NO_MEASURE
    assert {name.partition(",")[0] for name in ROWS} == expected | {*INVARIANT_WORDS}
