"""An agent that knows no mission: it hovers, gives way, claims no place and hears of none."""

from math import hypot
from pathlib import Path

import pytest

from agent.codec import decode_beacon
from agent.config import AgentSetup
from agent.controller import Intent, Senses
from agent.core import Agent
from agent.guidance.q_structure import QStructure
from agent.messages import NO_MISSION, ZERO, Place
from netem.wire.channels import LOCAL
from tests.agent.comms.builders import beacon
from tests.agent.test_core import TICK_S, deliver, observation
from worldsim.scenario.file import load

WEDGE = Path(__file__).parents[2] / "deploy" / "scenarios" / "wedge-9.toml"


class Claimant:
    """Keeps its senses, and claims a place whether or not there is one."""

    def __init__(self, setup: AgentSetup) -> None:
        self.senses: list[Senses] = []

    def decide(self, senses: Senses) -> Intent:
        self.senses.append(senses)
        CLAIMANTS[:] = [self]
        claimed = Place(0, 0)
        return Intent(ZERO, ZERO, 0.0, 0.0, ZERO, place=claimed, vertex=True, blocked=(claimed,))


CLAIMANTS: list[Claimant] = []


def unbriefed(controller: str = "q_structure") -> Agent:
    keys = {"fleet.briefed": "[]", "control.controller": controller}
    return Agent(load(WEDGE, keys).agent_setup(0, 0, 2))


@pytest.mark.parametrize(
    ("agent", "incarnation", "briefed", "knows"),
    [
        (3, 0, "'all'", True),
        (3, 1, "'all'", False),
        (9, 0, "'all'", False),
        (3, 0, "[3, 5]", True),
        (4, 0, "[3, 5]", False),
        (5, 1, "[3, 5]", False),
    ],
)
def test_who_takes_off_is_briefed_and_nobody_later(
    agent: int, incarnation: int, briefed: str, knows: bool
) -> None:
    moves = {"frame.waypoints_m": "[[1, 0, 0]]", "fleet.briefed": briefed, "fleet.spare": "1"}
    setup = load(WEDGE, moves).agent_setup(agent, incarnation, 2)
    assert (setup.formation is not None) == knows
    assert setup.frame.waypoints == (((1.0 if knows else 0.0), 0.0, 0.0),)


def test_it_hovers_claims_nothing_and_says_that_it_has_no_mission() -> None:
    core = unbriefed()
    for tick in range(60):
        deliver(core, beacon(1, tick + 1, tick * TICK_S, queue=0, rank=0), tick * TICK_S)
        outbox = core.step(observation(tick))
        telemetry = outbox.command.telemetry
        assert outbox.command.velocity == ZERO
        assert (telemetry.place, telemetry.target, telemetry.mission) == (None, None, NO_MISSION)
    sent = [decode_beacon(data) for channel, data in outbox.frames if channel == LOCAL]
    assert {(each.mission, each.frame_key, each.queue) for each in sent} == {(-1, -1, -1)}
    assert core.rejected.total() == 0


def test_it_gives_way_to_a_vehicle_that_comes() -> None:
    core, x = unbriefed(), 2.0
    for tick in range(20):
        coming = beacon(1, tick + 1, tick * TICK_S, at=(x - 0.3, 1.0, 0.5), velocity=(0.2, 0, 0))
        deliver(core, coming, tick * TICK_S)
        seen = observation(tick, vehicles=[(-0.3, 0.0, 0.0)])
        velocity = core.step(seen).command.velocity
    assert velocity[0] > 0.05
    assert hypot(*velocity) <= 0.5 + 1e-9


def test_a_claim_without_a_mission_is_no_claim() -> None:
    core = unbriefed(f"{__name__}:{Claimant.__name__}")
    lie = beacon(1, 1, 0.0, queue=0, rank=0, mission=NO_MISSION, blocked=(Place(0, 1),))
    deliver(core, lie, 0.0)
    for tick in range(2):
        outbox = core.step(observation(tick))
    assert outbox.command.telemetry.place is None
    (beaconed,) = [decode_beacon(data) for channel, data in outbox.frames if channel == LOCAL]
    assert (beaconed.queue, beaconed.blocked) == (-1, ())
    senses = CLAIMANTS[0].senses[-1]
    assert senses.mission is None
    assert [each.place for each in senses.neighbours] == [None]
    assert [each.place for each in senses.team()] == [None, None]
    assert senses.blocked == frozenset()


def test_with_the_senses_of_no_mission_the_controller_still_avoids_obstacles() -> None:
    controller = QStructure(load(WEDGE).agent_setup(0, 0, 2))
    senses = Senses(
        now_s=1.0,
        position=(0.0, 0.0, 0.0),
        velocity=ZERO,
        yaw=0.0,
        vehicles=(),
        neighbours=(),
        team=tuple,
        mission=None,
        obstacles=((0.35, 0.0, 0.0),),
    )
    intent = controller.decide(senses)
    assert intent.place is None
    assert intent.wanted[0] < 0.0
