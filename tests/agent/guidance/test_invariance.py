"""Invariance: the origin, the direction of north and the agents' ids decide nothing."""

from dataclasses import replace
from math import cos, dist, hypot, pi, remainder, sin, tau
from operator import attrgetter
from random import Random
from typing import NamedTuple

import msgspec
import pytest

from agent.config import AgentSetup, Comms, Control, Vehicle
from agent.controller import Flown, Heard, Peer, Senses, load
from agent.messages import Place
from agent.qstructure.formation import Formation, FormationSpec, QueueSpec
from agent.qstructure.shape import Ray
from agent.qstructure.target_frame import Frame

TEAM = 8
ROUNDING = 1e-9
WEDGE = FormationSpec(
    "wedge",
    {"V1": (0.3, -0.2, 0.5)},
    tuple(
        QueueSpec(f"Q{index}", ("V1",), Ray((-1.0, y, z)))
        for index, (y, z) in enumerate([(1.0, 1.0), (-1.0, 1.0), (1.0, -1.0), (-1.0, -1.0)])
    ),
)


class Move(NamedTuple):
    """A motion of the whole world: a turn about the vertical [rad], then a shift [m]."""

    yaw: float
    shift: tuple

    def turned(self, v):
        c, s = cos(self.yaw), sin(self.yaw)
        return (c * v[0] - s * v[1], s * v[0] + c * v[1], v[2])

    def moved(self, p):
        return tuple(a + b for a, b in zip(self.turned(p), self.shift, strict=True))


STAY = Move(0.0, (0.0, 0.0, 0.0))


def decided(controller, seed, move=STAY, ids=tuple(range(TEAM))):
    """Return agent 0's intent in a random situation that is moved and renumbered."""
    random = Random(seed)
    place = [tuple(random.uniform(-3, 3) for _ in range(3)) for _ in range(TEAM)]
    speed = [tuple(random.uniform(-0.3, 0.3) for _ in range(3)) for _ in range(TEAM)]
    goal = [tuple(a + random.uniform(-0.5, 0.5) for a in p) for p in place]
    yaw = random.uniform(-pi, pi)
    formation = Formation(WEDGE, 1.0)
    claims = [each if random.random() < 0.5 else None for each in formation.layout(TEAM).places]
    random.shuffle(claims)
    heard = sorted(
        [
            Heard(
                id=ids[i],
                age_s=0.05,
                position=move.moved(place[i]),
                velocity=move.turned(speed[i]),
                target=move.moved(goal[i]),
                place=claims[i],
            )
            for i in range(1, TEAM)
        ],
        key=attrgetter("id"),
    )
    team = tuple(
        sorted(
            (Peer(ids[i], move.moved(place[i]), claims[i]) for i in range(TEAM)),
            key=attrgetter("id"),
        )
    )
    near = [tuple(b - a for a, b in zip(place[0], p, strict=True)) for p in place[1:]]
    senses = Senses(
        now_s=1.0,
        position=move.moved(place[0]),
        velocity=move.turned(speed[0]),
        yaw=remainder(yaw + move.yaw, tau),
        vehicles=tuple(move.turned(v) for v in near if hypot(*v) <= 2.0),
        neighbours=tuple(heard),
        team=lambda: team,
        mission=Flown(key=0, formation=formation, frame=Frame(move.shift, move.yaw)),
    )
    made = load(controller)(setup(ids[0]))
    made.decide(replace(senses, now_s=0.0))  # it listens first
    return made.decide(senses)


def setup(own_id):
    return AgentSetup(
        id=own_id,
        incarnation=0,
        tick_hz=20.0,
        slots_per_tick=4,
        command_ticks=1,
        vehicle=Vehicle(),
        fleet_max_speed_mps=0.5,
        control=Control(allocation="assignment"),
        comms=Comms(),
        formation=WEDGE,
    )


def assert_same(one, other, move):
    """Assert that two intents are equal but for the move."""
    for turned in ("wanted", "velocity"):
        assert dist(move.turned(getattr(one, turned)), getattr(other, turned)) < ROUNDING
    assert dist(move.moved(one.heading_for), other.heading_for) < ROUNDING
    if one.target is not None:
        assert dist(move.moved(one.target), other.target) < ROUNDING
    assert abs(remainder(one.yaw + move.yaw - other.yaw, tau)) < ROUNDING
    assert other.force == pytest.approx(one.force, abs=ROUNDING)
    assert one.place == other.place
    assert one.tilt == other.tilt


@pytest.mark.parametrize("controller", ["q_structure", "flocking"])
def test_a_moved_world_gives_a_moved_intent(controller):
    random = Random(1)
    for seed in range(150):
        shift = tuple(random.uniform(-50, 50) for _ in range(3))
        for move in (
            Move(0.0, shift),
            Move(random.uniform(-pi, pi), (0.0, 0.0, 0.0)),
            Move(2.0, shift),
        ):
            assert_same(decided(controller, seed), decided(controller, seed, move), move)


@pytest.mark.parametrize("controller", ["q_structure", "flocking"])
def test_ids_decide_nothing(controller):
    random = Random(2)
    for seed in range(300):
        ids = tuple(random.sample(range(1000), TEAM))
        assert_same(decided(controller, seed), decided(controller, seed, ids=ids), STAY)


def test_the_situations_are_of_every_kind():
    """Some agents turn, some fly; their places differ."""
    intents = [decided("q_structure", seed) for seed in range(150)]
    assert 20 < sum(each.velocity == each.wanted for each in intents) < 140
    assert len({each.place for each in intents}) == TEAM
    assert all(isinstance(each.place, Place) for each in intents)


def test_a_formation_moved_by_its_vertices_is_the_same_formation_moved():
    move = Move(0.7, (3.0, -2.0, 1.0))
    queues = tuple(
        msgspec.structs.replace(queue, shape=Ray(move.turned(queue.shape.direction)))
        for queue in WEDGE.queue
    )
    moved = Formation(FormationSpec("moved", {"V1": move.moved(WEDGE.vertices["V1"])}, queues), 1.0)
    here, there = Formation(WEDGE, 1.0).layout(9), moved.layout(9)
    assert here.places == there.places
    for place in here.places:
        assert dist(move.moved(here.slots[place].point), there.slots[place].point) < ROUNDING
