"""The dodge: a way out where a body dead ahead holds an agent by symmetry (E23).

The safety filter slides past what is off the axis; straight ahead there is no side to slide to, and
two agents that must swap hold each other for ever. After a second without progress an agent adds
a sideways velocity until nothing is ahead. It dodges up or down, since vehicles climb without
turning: under a body that is higher, over one that is lower, which leads forward and so stays in
the cone; of two agents on one level the lower id goes up. Right above or below a body it goes
ahead.
"""

from collections.abc import Sequence
from math import cos, dist, hypot, sin

from agent.controller import Heard, Senses
from agent.messages import Vector

ARRIVED_M = 0.12
PROGRESS_M = 0.05
PATIENCE_S = 1.0
NEAR_M = 0.9
AHEAD = 0.5
"""Cosine of the angle within which a body is in the way."""
NEW_M = 0.2
"""A target that moves farther than this between two steps is another one."""
STEEP = 0.7
LEVEL = 0.02
SAME_BODY_M = 0.4


class Dodge:
    """Watches one agent's progress towards its target."""

    def __init__(self, own_id: int) -> None:
        self._own_id = own_id
        self._target: Vector | None = None
        self._nearest_m = 0.0
        self._since_s = 0.0
        self._side: float | None = None

    def direction(self, senses: Senses, target: Vector) -> Vector | None:
        """Return the unit vector to dodge along [world axes]; None where nothing holds one."""
        if self._moves_on(senses, target):
            self._side = None
            return None
        if senses.now_s - self._since_s < PATIENCE_S:
            return None
        body = _ahead(senses.position, target, senses.vehicles)
        if body is None:
            self._side = None
            return None
        if self._side is None:
            self._side = self._choose_side(senses, body)
        return _tangent(body, senses.yaw, self._side)

    def _moves_on(self, senses: Senses, target: Vector) -> bool:
        """Whether there is nothing to complain of: arrived, a new target, or not yet patient."""
        away_m = dist(senses.position, target)
        before, self._target = self._target, target
        if before is None or away_m < ARRIVED_M or dist(before, target) > NEW_M:
            self._nearest_m, self._since_s = away_m, senses.now_s
            return True
        if target != before:
            self._nearest_m += away_m - dist(senses.position, before)
        if away_m < self._nearest_m - PROGRESS_M:
            self._nearest_m = away_m
            if self._side is None:
                self._since_s = senses.now_s
        return False

    def _choose_side(self, senses: Senses, body: Vector) -> float:
        if abs(body[2]) > LEVEL * hypot(*body):
            return -1.0 if body[2] > 0.0 else 1.0
        x, y, z = senses.position
        there = (x + body[0], y + body[1], z + body[2])
        other = _whose(there, senses.neighbours)
        return 1.0 if other is None or self._own_id < other else -1.0


def _ahead(position: Vector, target: Vector, vehicles: Sequence[Vector]) -> Vector | None:
    """Return the nearest body in the way, relative to the vehicle [m]."""
    x, y, z = target[0] - position[0], target[1] - position[1], target[2] - position[2]
    away = max(hypot(x, y, z), 1e-9)
    in_way = [
        body
        for body in vehicles
        if 0.0 < (r := hypot(*body)) < NEAR_M
        and x * body[0] + y * body[1] + z * body[2] > AHEAD * r * away
    ]
    return min(in_way, key=lambda body: hypot(*body), default=None)


def _whose(there: Vector, neighbours: Sequence[Heard]) -> int | None:
    near = [other for other in neighbours if dist(other.position, there) < SAME_BODY_M]
    return min(near, key=lambda other: dist(other.position, there)).id if near else None


def _tangent(body: Vector, yaw: float, side: float) -> Vector:
    """Return the unit vector across the line to a body: upright, or along the heading."""
    r = hypot(*body)
    n = (body[0] / r, body[1] / r, body[2] / r)
    across = (0.0, 0.0, side) if abs(n[2]) < STEEP else (cos(yaw), sin(yaw), 0.0)
    along = n[0] * across[0] + n[1] * across[1] + n[2] * across[2]
    t = (across[0] - along * n[0], across[1] - along * n[1], across[2] - along * n[2])
    length = hypot(*t)
    return (t[0] / length, t[1] / length, t[2] / length)
