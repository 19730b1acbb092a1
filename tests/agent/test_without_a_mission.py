"""An agent that knows no mission: it gives way, claims no place, and hovers or keeps pace."""

from math import dist, hypot
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from agent.codec import decode_beacon, decode_command, encode
from agent.comms.mission import KEYS_PER_VERSION
from agent.comms.reported_frame import MAX_EXTRAPOLATION_S
from agent.config import AgentSetup
from agent.controller import Intent, Senses
from agent.core import Agent, Outbox
from agent.guidance.q_structure import QStructure
from agent.messages import (
    DISTRESS,
    FRAME_M,
    HOME,
    MAX_ANGLE_RAD,
    NO_MISSION,
    ZERO,
    Beacon,
    Drift,
    Place,
    Pose,
    Vector,
)
from netem.wire.channels import LOCAL
from tests.agent.comms.builders import beacon
from tests.agent.comms.test_reported_frame import standing
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


DRIFT_MPS = 0.3
TIER = standing(1)


def moving(tick: int, agent: int = 1, **fields: Any) -> Beacon:
    """Return a beacon of a member of tier 1, 3 m away, whose frame moves along x."""
    now_s = tick * TICK_S
    frame, drift = Pose(DRIFT_MPS * now_s, 0, 0, 0), Drift(now_s, DRIFT_MPS, 0, 0, 0)
    made = {"at": (5.0, 1.0, 0.5), "target": (5.0, 1.0, 0.5), "standing": TIER, **fields}
    return beacon(agent, tick + 1, now_s, **({"frame": frame, "drift": drift} | made))


def flown(core: Agent, tick: int, at: Vector, heard: list[Beacon]) -> tuple[Vector, Outbox]:
    """Let an agent step; return where a vehicle that flies as told is one tick later."""
    for each in heard:
        deliver(core, each, tick * TICK_S)
    outbox = core.step(observation(tick, at))
    x, y, z = (p + TICK_S * v for p, v in zip(at, outbox.command.velocity, strict=True))
    return (x, y, z), outbox


def test_it_keeps_pace_with_the_frame_of_a_tier_and_says_nothing_of_it() -> None:
    core, start = unbriefed(), (2.0, 1.0, 0.5)
    at = start
    for tick in range(200):
        heard = [moving(tick)] if tick < 80 else []
        at, outbox = flown(core, tick, at, heard)
        told = outbox.command.telemetry
        assert (told.mission, told.place, told.target) == (NO_MISSION, None, None)
        assert (told.role, told.tier) == (DISTRESS, -1)
        for sent in [decode_beacon(data) for channel, data in outbox.frames if channel == LOCAL]:
            assert (sent.frame_key, sent.frame, sent.drift, sent.queue) == (-1, HOME, None, -1)
            assert sent.standing is None
        if tick in (79, 150):
            away_m = dist(at, (start[0] + DRIFT_MPS * tick * TICK_S, *start[1:]))
            assert away_m < 0.1, "it loses the frame while that is extrapolated"
    stopped_m = start[0] + DRIFT_MPS * (79 * TICK_S + MAX_EXTRAPOLATION_S)
    assert at[0] == pytest.approx(stopped_m, abs=0.1)
    assert outbox.command.velocity == ZERO


ANY_FRAME = st.tuples(
    *[st.sampled_from((-FRAME_M, -50_000.0, 0.0, 4.0, FRAME_M))] * 3,
    st.sampled_from((-MAX_ANGLE_RAD, 0.0, 1.0, MAX_ANGLE_RAD)),
)
ANY_DRIFT = st.none() | st.tuples(*[st.sampled_from((-100.0, 0.0, 0.3, 100.0))] * 4)


@settings(max_examples=60, deadline=None)
@given(frames=st.lists(st.tuples(ANY_FRAME, ANY_DRIFT, st.integers(0, 2)), max_size=6))
def test_whatever_frame_a_liar_reports_it_flies_within_its_limits(
    frames: list[tuple[Any, Any, int]],
) -> None:
    core, at, tick = unbriefed(), (2.0, 1.0, 0.5), 0
    for pose, velocity, version in frames:
        key = version * KEYS_PER_VERSION
        drift = None if velocity is None else Drift(tick * TICK_S, *velocity)
        lie = moving(tick, 2, frame=Pose(*pose), drift=drift, frame_key=key)
        for _ in range(4):
            before, (at, outbox) = at, flown(core, tick, at, [lie, moving(tick)])
            assert dist(before, at) <= 0.5 * TICK_S + 1e-9
            decode_command(encode(outbox.command))
            for _, data in (each for each in outbox.frames if each[0] == LOCAL):
                decode_beacon(data)
            tick += 1
    assert core.rejected["invalid"] == 0
