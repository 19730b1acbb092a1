"""A run in a rotated and shifted world is the same run, rotated and shifted.

Rotation and shift change the rounding, and the potential field amplifies the difference while
agents pass each other. The tolerance below is far under any distance that matters.
"""

from functools import cache
from math import cos, degrees, pi, radians, sin
from random import Random

import numpy as np
import pytest

from worldsim.engine.virtual import VirtualFleet
from worldsim.scenario.file import parse

TOLERANCE_M = 1e-9
"""Coordinates up to 30 m round by 4e-15 m each step; 400 steps, amplified: 3e-13 was seen."""
DURATION_S = 5.0
EDGES = [(-1, 1, 1), (-1, -1, 1), (-1, 1, -1), (-1, -1, -1)]
AGENTS = 7


class Motion:
    """A rigid motion: a rotation about the vertical [rad], then a shift [m]."""

    def __init__(self, yaw, shift):
        self.yaw = yaw
        c, s = cos(yaw), sin(yaw)
        self._turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
        self._shift = np.array(shift, dtype=float)

    def points(self, points):
        return np.array(points, dtype=float) @ self._turn.T + self._shift

    def directions(self, directions):
        return np.array(directions, dtype=float) @ self._turn.T


def text(seed, move):
    """Return the scenario of a seed, moved."""
    random = Random(seed)
    starts = [
        [2.0 * cos(k * 2.0 * pi / AGENTS), 2.0 * sin(k * 2.0 * pi / AGENTS), random.uniform(-1, 1)]
        for k in range(AGENTS)
    ]
    random.shuffle(starts)
    turns = [degrees(random.uniform(-pi, pi)) for _ in starts]
    yaws = [(turn + degrees(move.yaw) + 180.0) % 360.0 - 180.0 for turn in turns]
    apex = move.points([(0.5, 0.2, -0.1)])[0].tolist()
    edges = move.directions(EDGES).tolist()
    queues = ",".join(
        f'{{ name = "Q{k}", vertices = ["V1"], shape = {{ kind = "ray", direction = {edge} }} }}'
        for k, edge in enumerate(edges)
    )
    return f"""
[fleet]
agents = {AGENTS}
start = {{ kind = "list", positions_m = {move.points(starts).tolist()}, yaws_deg = {yaws} }}
[formation]
name = "wedge"
vertices = {{ V1 = {apex} }}
queue = [{queues}]
"""


def flown(seed, move):
    """Return all positions (slots, agents, 3) [m; world frame] and the final places."""
    scenario = parse(text(seed, move))
    fleet, track = VirtualFleet(scenario), []
    for _ in range(round(DURATION_S * scenario.slot_hz)):
        fleet.slot()
        track.append(fleet.loop.world.vehicles.position.copy())
    return np.array(track), [command.telemetry.place for command in fleet.loop.world.latest]


@cache
def unmoved(seed):
    """Return the same of a seed where it lies, flown once for all motions."""
    return flown(seed, Motion(0.0, (0.0, 0.0, 0.0)))


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize(
    ("yaw_deg", "shift_m"),
    [
        (0.0, (16.0, -8.0, 4.0)),
        (90.0, (0.0, 0.0, 0.0)),
        (33.0, (0.0, 0.0, 0.0)),
        (-151.0, (3.1, 20.7, -9.3)),
    ],
)
def test_a_run_in_a_moved_world_is_the_same_run_moved(seed, yaw_deg, shift_m):
    move = Motion(radians(yaw_deg), shift_m)
    here, places = unmoved(seed)
    there, moved_places = flown(seed, move)
    assert moved_places == places
    assert np.abs(move.points(here) - there).max() < TOLERANCE_M
    assert np.abs(here[-1] - here[0]).max() > 0.5, "no vehicle moved"
