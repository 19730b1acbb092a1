"""Lemma 7 with teeth: u_i needs no news of agents out of range at the start of a cycle (E20)."""

from math import cos, dist, pi, radians, sin
from random import Random
from typing import NamedTuple

from agent.config import Control, Vehicle
from agent.guidance import bobber as bobber_room
from agent.guidance import potential as potential_room
from agent.guidance import q_structure
from agent.guidance.cone import azimuth_error, cone_of
from agent.guidance.movement import saturated, steer
from agent.messages import Vector
from tests.laws.energy import D_OB, SPEED_MPS, TICK_S, Other, scattered

CONTROL, VEHICLE = Control(), Vehicle()
RANGES_M = (3.0, 4.0, 6.0)
"""With a range of 2 m, agents that part change Omega by up to 2.3 mm (docs/method.md, E20)."""
CYCLE_S = 3.0
"""A cycle ends here at the latest."""
ARRIVED_M = 0.01
NEGLIGIBLE_M = 1e-3
"""Of Omega_i; times c that is 2 mm/s."""


class Flyer(NamedTuple):
    """An agent at one tick of a cycle; its immediate target stays for the whole cycle."""

    position: Vector
    yaw: float
    target: Vector


def cast(range_m: float, places: list[Vector], yaws: list[float], toq: list[Vector]):
    """Return a team at the start of a cycle: each has cast its bobber, by the range of the radio.

    places, toq: positions and targets-on-queue [m]; yaws [rad].
    """
    zone = bobber_room.cast_zone(
        cone_of(VEHICLE),
        bobber_room.cast_reach(CONTROL, range_m),
        VEHICLE.max_speed_mps,
        radians(VEHICLE.max_yaw_rate_dps),
    )
    return [
        Flyer(q, yaw, bobber_room.bobber(q, yaw, t, zone))
        for q, yaw, t in zip(places, yaws, toq, strict=True)
    ]


def moved(flyer: Flyer, omega: Vector) -> Flyer:
    """Return an agent one tick later: Algorithm 4, lines 4-8."""
    wanted = saturated(tuple(-q_structure.GAIN * x for x in omega), SPEED_MPS, SPEED_MPS)
    velocity, heading = steer(wanted, flyer.yaw, cone_of(VEHICLE))
    turn = azimuth_error(cos(heading), sin(heading), flyer.yaw)
    most = radians(VEHICLE.max_yaw_rate_dps) * TICK_S
    position = tuple(q + TICK_S * v for q, v in zip(flyer.position, velocity, strict=True))
    return Flyer(position, flyer.yaw + max(-most, min(most, turn)), flyer.target)


def unheard_share(range_m: float, team: list[Flyer]) -> float:
    """Fly one cycle; return what those out of range at its start change in an Omega_i [m]."""
    potential = potential_room.Potential(D_OB)
    others = [[j for j in range(len(team)) if j != i] for i in range(len(team))]
    near = [
        [j for j in others[i] if dist(team[i].position, team[j].position) < range_m]
        for i in range(len(team))
    ]
    worst, ticks = 0.0, round(CYCLE_S / TICK_S)
    while ticks and max(dist(each.position, each.target) for each in team) > ARRIVED_M:
        seen = [Other(each.position, each.target) for each in team]

        def omega(i: int, of: list[int], team=team, seen=seen) -> Vector:
            return potential.omega(team[i].position, team[i].target, [seen[j] for j in of])

        full = [omega(i, others[i]) for i in range(len(team))]
        heard = [omega(i, near[i]) for i in range(len(team))]
        worst = max([worst, *map(dist, full, heard)])
        team = [moved(each, own) for each, own in zip(team, full, strict=True)]
        ticks -= 1
    return worst


def who_is_out_of_range_does_not_count() -> None:
    """Lemma 7: Omega_i with and without agents that were out of range at the cycle's start."""
    random = Random(71)
    for trial in range(60):
        range_m = RANGES_M[trial % 3]
        size, count = 0.7 * range_m, 3 + trial % 6
        places = scattered(random, count, size, 0.6)
        toq = scattered(random, count, size, CONTROL.spacing_m)
        yaws = [random.uniform(-pi, pi) for _ in range(count)]
        share = unheard_share(range_m, cast(range_m, places, yaws, toq))
        assert share < NEGLIGIBLE_M, f"trial {trial}, {range_m:g} m: Omega differs by {share}"


def strangers_do_not_count() -> None:
    """Lemma 7 at its worst: a pair just out of range flies straight at each other, or apart."""
    for range_m in RANGES_M:
        places: list[Vector] = [(0.0, 0.0, 0.0), (range_m, 0.0, 0.0)]
        toq: list[Vector] = [(9.0, 0.0, 0.0), (-9.0, 0.0, 0.0)]
        for yaws, aims in (([0.0, pi], toq), ([pi, 0.0], toq[::-1])):
            share = unheard_share(range_m, cast(range_m, places, yaws, aims))
            assert share < NEGLIGIBLE_M, f"{range_m:g} m, heading {yaws}: Omega differs by {share}"


LAWS = {
    "Lemma 7 far": who_is_out_of_range_does_not_count,
    "Lemma 7 pair": strangers_do_not_count,
}
