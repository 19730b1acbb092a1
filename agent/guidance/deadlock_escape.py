"""The dodge: a way out where a body dead ahead holds an agent by symmetry (E23).

The safety filter slides past what is off the axis; straight ahead there is no side to slide to, and
two agents that must swap hold each other for ever. After a second without progress an agent adds
a sideways velocity until nothing is ahead. It dodges up or down, since vehicles climb without
turning: under a body that is higher, over one that is lower, which leads forward and so stays in
the cone; of two agents on one level the lower id goes up. Right above or below a body it goes
ahead.

Round what does not fly it goes along the surface, to the side to which the way to the target leans
there, or up where it leans nowhere; a side that brings no progress for some seconds is changed for
the next, a quarter round.
"""

from collections.abc import Sequence
from math import cos, dist, hypot, sin

from agent.controller import Heard, Senses
from agent.messages import ZERO, Vector

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
SURFACE_M = 1.1
"""So near, a point of a surface can hold an agent: d_s, and what the lines look ahead."""
BEHIND_M = 1.5
"""Who is nearer to its slot than this is on its way round what it passes, not held by it."""
LEANS = 0.02
SIDE_S = 5.0
"""So long a side round an obstacle is tried."""


class Dodge:
    """Watches one agent's progress towards its target."""

    def __init__(self, own_id: int) -> None:
        self._own_id = own_id
        self._target: Vector | None = None
        self._nearest_m = 0.0
        self._since_s = 0.0
        self._side: float | None = None
        self._along: Vector | None = None
        self._along_s = 0.0

    @property
    def rounds(self) -> bool:
        """Whether it is going round what does not fly."""
        return self._along is not None

    def direction(self, senses: Senses, target: Vector) -> Vector | None:
        """Return the unit vector to dodge along [world axes]; None where nothing holds one."""
        if self._moves_on(senses, target):
            self._side = self._along = None
            return None
        if senses.now_s - self._since_s < PATIENCE_S:
            return None
        way = _way(senses.position, target)
        body = _ahead(way, senses.vehicles, NEAR_M)
        if body is None:
            self._side = None
            behind = self._along is not None or dist(senses.position, target) > BEHIND_M
            return self._round(senses, way) if behind else None
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
            if self._side is None and self._along is None:
                self._since_s = senses.now_s
        return False

    def _round(self, senses: Senses, way: Vector) -> Vector | None:
        """Return the unit vector along the surface that is in the way, if there is one."""
        point = _ahead(way, senses.obstacles, SURFACE_M)
        if point is None:
            self._along = None
            return None
        if self._along is None:
            self._along, self._along_s = _leaning(way, point), senses.now_s
        elif senses.now_s - self._along_s > SIDE_S:
            self._along, self._along_s = _next_side(self._along, point), senses.now_s
        return _across(self._along, point)

    def _choose_side(self, senses: Senses, body: Vector) -> float:
        if abs(body[2]) > LEVEL * hypot(*body):
            return -1.0 if body[2] > 0.0 else 1.0
        x, y, z = senses.position
        there = (x + body[0], y + body[1], z + body[2])
        other = _whose(there, senses.neighbours)
        return 1.0 if other is None or self._own_id < other else -1.0


def _way(position: Vector, target: Vector) -> Vector:
    """Return the unit vector from a position to a target."""
    x, y, z = target[0] - position[0], target[1] - position[1], target[2] - position[2]
    away = max(hypot(x, y, z), 1e-9)
    return (x / away, y / away, z / away)


def _ahead(way: Vector, bodies: Sequence[Vector], near_m: float) -> Vector | None:
    """Return the nearest body in the way, relative to the vehicle [m]."""
    x, y, z = way
    in_way = [
        body
        for body in bodies
        if 0.0 < (r := hypot(*body)) < near_m
        and x * body[0] + y * body[1] + z * body[2] > AHEAD * r
    ]
    return min(in_way, key=lambda body: hypot(*body), default=None)


def _whose(there: Vector, neighbours: Sequence[Heard]) -> int | None:
    near = [other for other in neighbours if dist(other.position, there) < SAME_BODY_M]
    return min(near, key=lambda other: dist(other.position, there)).id if near else None


def _tangent(body: Vector, yaw: float, side: float) -> Vector:
    """Return the unit vector across the line to a body: upright, or along the heading."""
    steep = abs(body[2]) >= STEEP * hypot(*body)
    return _across((cos(yaw), sin(yaw), 0.0) if steep else (0.0, 0.0, side), body)


def _leaning(way: Vector, point: Vector) -> Vector:
    """Return the side round a point to which the way leans, or up where it leans nowhere."""
    n = _way(ZERO, point)
    along = n[0] * way[0] + n[1] * way[1] + n[2] * way[2]
    lean = (way[0] - along * n[0], way[1] - along * n[1], way[2] - along * n[2])
    if hypot(*lean) > LEANS:
        return lean
    return (0.0, 0.0, 1.0) if abs(n[2]) < STEEP else (1.0, 0.0, 0.0)


def _next_side(side: Vector, point: Vector) -> Vector:
    """Return the side to try next: a quarter round the line to the point."""
    n, t = _way(ZERO, point), _across(side, point)
    return (n[1] * t[2] - n[2] * t[1], n[2] * t[0] - n[0] * t[2], n[0] * t[1] - n[1] * t[0])


def _across(direction: Vector, body: Vector) -> Vector:
    """Return the unit vector across the line to a body that is nearest to a direction."""
    n = _way(ZERO, body)
    along = n[0] * direction[0] + n[1] * direction[1] + n[2] * direction[2]
    t = (
        direction[0] - along * n[0],
        direction[1] - along * n[1],
        direction[2] - along * n[2],
    )
    length = max(hypot(*t), 1e-9)
    return (t[0] / length, t[1] / length, t[2] / length)
