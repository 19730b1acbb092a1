"""Colours keep their meaning: of a queue in a formation, of an agent where there is none."""

from dataclasses import replace

import msgspec
import numpy as np

from agent.messages import DISTRESS, MEMBER
from agent.qstructure.formation import Formation
from tests.recording.flights import straight_flight, wedge
from worldsim.judge.tick import HierarchyRows, Tick
from worldsim.recording import palette
from worldsim.recording.agent_colours import AgentColours

AGENTS = 9
SCENARIO = wedge(AGENTS, duration_s=2.0)
FORMATION = Formation(SCENARIO.formation, 1.0)


def ticks(*, placed: bool, role: int = MEMBER, dead: int | None = None) -> list[Tick]:
    hierarchy = HierarchyRows(
        tier=np.zeros(AGENTS, dtype=np.int16),
        parent=np.full(AGENTS, -1, dtype=np.int32),
        role=np.full(AGENTS, role, dtype=np.int8),
        record_age_s=np.zeros(AGENTS, dtype=np.float32),
    )
    return [
        replace(
            tick,
            place=tick.place if placed else np.full_like(tick.place, -1),
            hierarchy=hierarchy,
            alive=np.arange(AGENTS) != dead,
        )
        for tick in straight_flight(SCENARIO)
    ]


def coloured(colours: AgentColours, flown: list[Tick], dead: tuple[int, ...] = ()) -> np.ndarray:
    ended = [np.isin(np.arange(AGENTS), dead)] * len(flown)
    return colours.vehicles(flown, ended)


def test_a_controller_that_forms_nothing_has_a_colour_for_each_agent() -> None:
    colours = AgentColours(AGENTS, FORMATION, forms=False)
    (row,) = coloured(colours, ticks(placed=False)[:1])
    assert len(set(row.tolist())) == AGENTS
    assert not {int(palette.IN_DISTRESS), int(palette.UNPLACED)} & set(row.tolist())
    assert colours.series().tolist() == row.tolist()


def test_curves_keep_the_colour_of_their_queue_through_distress_and_death() -> None:
    colours = AgentColours(AGENTS, FORMATION, forms=True)
    placed = coloured(colours, ticks(placed=True)[:1])[0]
    series = colours.series()
    assert series.tolist() == placed.tolist()
    lost = coloured(colours, ticks(placed=False, role=DISTRESS, dead=3)[:1])[0]
    assert lost[3] == palette.NOT_RUNNING
    assert set(np.delete(lost, 3).tolist()) == {int(palette.IN_DISTRESS)}
    assert colours.series().tolist() == series.tolist()
    assert coloured(colours, ticks(placed=True, dead=3)[:1], (3,))[0, 3] == palette.DEAD


def test_agents_have_the_colours_of_their_own_mission() -> None:
    """Places shared by queues of the first formation are not shared in a line."""
    tick = ticks(placed=True)[0]
    colours = AgentColours(AGENTS, FORMATION, forms=True)
    spec = SCENARIO.formation
    line = msgspec.structs.replace(spec, queue=spec.queue[:1])
    colours.begin_phase(Formation(line, 1.0), 1024)
    apex = int(np.flatnonzero((tick.place == 0).all(axis=1))[0])
    before, after = coloured(colours, [tick, replace(tick, mission=np.full(AGENTS, 1024))])
    assert before[apex] == palette.SHARED_VERTEX
    assert after[apex] == palette.QUEUES[0]
