"""Dead vehicles in a closed queue: a team that stands right around them has re-formed."""

from collections.abc import Iterator

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from agent.controller import Flown
from agent.places.place_points import PlacePoints
from agent.qstructure.formation import Formation
from agent.qstructure.target_frame import Frame
from worldsim.engine.virtual import fly
from worldsim.judge.run_events import Killed
from worldsim.judge.tick import Tick
from worldsim.judge.verdict import Judge
from worldsim.scenario.file import load
from worldsim.scenario.library import SCENARIOS

SCENARIO = load(SCENARIOS / "figure-1a-12.toml", overrides={"expect.reform_within_s": "30"})
AGENTS = SCENARIO.fleet.agents
FORMATION = Formation(SCENARIO.formation, SCENARIO.control.spacing_m)
KILLED_AT, LAST = 60, 200
"""Ticks at which the agents die, and at which the flight ends."""


def standing(team: list[int], alive_at: int) -> Iterator[Tick]:
    """Yield ticks in which all stand in formation, and later a team around the others' bodies."""
    full = FORMATION.layout(AGENTS)
    place = np.array(full.places, dtype=np.int16)
    position = np.array([full.slots[each].point for each in full.places])
    dead = [row for row in range(AGENTS) if row not in team]
    bodies = [tuple(each) for each in position[dead].tolist()]
    mission = Flown(0, FORMATION, Frame())
    blocked = PlacePoints(SCENARIO.control.spacing_m).taken_by(mission, len(team), bodies)
    left = FORMATION.layout(len(team), frozenset(blocked))
    for index in range(LAST):
        alive = np.ones(AGENTS, dtype=np.bool_)
        if index >= alive_at:
            alive[dead] = False
        if index == alive_at:
            place[team] = left.places
            position[team] = [left.slots[each].point for each in left.places]
        yield Tick(
            index=index,
            time_s=index / 20,
            position=position.copy(),
            attitude=np.zeros((AGENTS, 3), dtype=np.float32),
            target=position.astype(np.float32),
            place=np.where(alive[:, None], place, -1).astype(np.int16),
            force=np.zeros(AGENTS, dtype=np.float32),
            turn_deg=np.full(AGENTS, np.nan),
            alive=alive,
            links=np.zeros((0, 2), dtype=np.int32),
            mission=np.zeros(AGENTS, dtype=np.int64),
        )


@settings(max_examples=30, deadline=None)
@given(team=st.sets(st.integers(0, AGENTS - 1), min_size=2, max_size=AGENTS - 1).map(sorted))
def test_a_team_that_stands_around_bodies_has_reformed(team: list[int]) -> None:
    judge = Judge(SCENARIO)
    for tick in standing(team, KILLED_AT):
        if tick.index == KILLED_AT:
            for row in sorted({*range(AGENTS)} - {*team}):
                judge.handle_event(Killed(t_s=tick.time_s, agent=row, planned=True))
        figures = judge.see(tick)
    np.testing.assert_allclose(figures.slot_error[team], 0.0, atol=1e-9)
    (recovery,) = judge.recoveries
    assert recovery.reformed_s == 0.0


def test_survivors_of_a_flight_re_form_between_bodies() -> None:
    """Agents 0, 4 and 6 die in their places on closed queues."""
    kill = {"event": "[{ at_s = 15.0, kill = [0, 4, 6] }]", "duration_s": "25"}
    judge = fly(load(SCENARIOS / "figure-1a-12.toml", overrides=kill)).loop.judge
    (recovery,) = judge.recoveries
    assert recovery.reformed_s is not None
    assert recovery.reformed_s < 6.0
