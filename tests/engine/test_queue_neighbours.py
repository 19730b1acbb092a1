"""N_c,i: of the agents that an agent hears, those of its own queue."""

import msgspec
import pytest

from agent.messages import Place, Telemetry
from agent.qstructure.formation import formation_of
from tests.recording.flights import wedge
from worldsim.engine.queue_neighbours import QueueNeighbours
from worldsim.engine.telemetry import NO_TELEMETRY
from worldsim.engine.virtual import VirtualFleet
from worldsim.judge.phase import Phase
from worldsim.scenario.file import parse

FORMATION = formation_of(wedge(9).formation, 1.0)
APEX, FIRST, SECOND, OTHER = Place(0, 0), Place(1, 1), Place(1, 2), Place(2, 1)
PLACES = (APEX, FIRST, SECOND, OTHER, None)
"""Of agents 0 to 4."""


def telemetry(agent: int, mission: int = 0, parent: int = -1) -> Telemetry:
    heard = tuple(other for other in range(len(PLACES)) if other != agent)
    return msgspec.structs.replace(
        NO_TELEMETRY, place=PLACES[agent], heard=heard, mission=mission, parent=parent
    )


def after_a_round(**flown: int) -> QueueNeighbours:
    """Return the counter after every agent reported once; ``a3=1``: agent 3 flies mission 1."""
    phases = [Phase(FORMATION, 0.0), Phase(FORMATION, 5.0, mission=1)]
    neighbours = QueueNeighbours(len(PLACES), phases)
    for agent in range(len(PLACES)):
        neighbours.count(agent, telemetry(agent, flown.get(f"a{agent}", 0)))
    return neighbours


@pytest.mark.parametrize(("agent", "needed"), [(0, 3), (1, 2), (2, 2), (3, 1), (4, None)])
def test_an_agent_needs_its_queue_and_the_shared_vertex_all_queues(agent, needed) -> None:
    assert after_a_round().count(agent, telemetry(agent)) == needed


def test_agents_of_another_mission_are_of_no_queue_of_ones_own() -> None:
    neighbours = after_a_round(a1=1)
    assert neighbours.count(1, telemetry(1, mission=1)) == 0
    assert neighbours.count(2, telemetry(2)) == 1


def test_a_parent_counts_whatever_it_claims_by_now() -> None:
    assert after_a_round().count(2, telemetry(2, parent=3)) == 3


def test_agents_that_do_not_exist_are_not_needed() -> None:
    lie = msgspec.structs.replace(telemetry(1), heard=(0, 2, 700), parent=700)
    assert after_a_round().count(1, lie) == 2


TWO_LINES = """
duration_s = 12.0
[fleet]
agents = 8
start = { kind = "box", size_m = [4, 4, 2], spacing_m = 0.6 }
[netem]
range_m = 20.0
[formation]
name = "lines"
vertices = { V1 = [0, 2, 0], V2 = [0, -2, 0] }
queue = [
    { name = "Q1", vertices = ["V1"], shape = { kind = "ray", direction = [-1, 0, 0] } },
    { name = "Q2", vertices = ["V2"], shape = { kind = "ray", direction = [-1, 0, 0] } },
]
"""


def test_of_two_queues_in_one_range_half_of_what_is_heard_is_needed() -> None:
    scenario = parse(TWO_LINES)
    fleet = VirtualFleet(scenario)
    while fleet.loop.world.time_s < 8.0:
        fleet.slot()
    formed = fleet.loop.radio_use.needed()
    assert all(3 <= most <= 7 for most in formed.most)
    heard = {len(command.telemetry.heard) for command in fleet.loop.world.latest}
    assert heard == {7}
    counted = QueueNeighbours(scenario.rows, fleet.loop.judge.phases)
    for _ in range(2):
        needed = [
            counted.count(agent, command.telemetry)
            for agent, command in enumerate(fleet.loop.world.latest)
        ]
    assert needed == [3] * 8
