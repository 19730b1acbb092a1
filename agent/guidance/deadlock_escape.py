"""Escape manoeuvre for an agent that a vehicle dead ahead holds by symmetry (E23).

The safety filter slides past what is off the axis. Straight ahead there is no side to slide to, and
two agents that must swap places hold each other for ever. After a second without progress an agent
adds a sideways velocity until nothing is ahead. It escapes up or down, since vehicles climb without
turning: under a higher vehicle, over a lower one, which leads forward and so stays in the cone. Of
two agents on one level, the lower id goes up. Directly above or below a vehicle it goes to the side
on which it is. It keeps on round the vehicle the way that it began, and so does the other one: two
that chose anew on the way would undo what they had gained.

So near to a vehicle that a noisy sensor leaves open only the way back, no agent gets round. One
that has stood by a vehicle for some seconds backs off from it first.

Round an obstacle it goes along the surface, to the side to which the way to the target leans there,
or up where it does not lean. A side that brings no progress for some seconds is changed for the
next one, a quarter turn on.
"""

from collections.abc import Sequence
from math import dist, hypot
from typing import Final

from agent.comms.unidentified_vehicles import SAME_MEMBER_M
from agent.controller import Heard, Senses
from agent.messages import ZERO, Vector
from agent.vectors import apart

ARRIVED_M: Final = 0.12
PROGRESS_M: Final = 0.05
PATIENCE_S: Final = 1.0
VEHICLE_NEAR_M: Final = 0.9
AHEAD: Final = 0.5
"""Cosine of the angle within which a vehicle or a surface is in the way."""
NEW_TARGET_M: Final = 0.2
"""A target that moves farther than this between two steps is another target."""
STEEP: Final = 0.7
"""Sine of the elevation from which a vehicle counts as directly above or below."""
LEVEL: Final = 0.02
"""Sine of the elevation up to which a vehicle counts as on the own level."""
SURFACE_NEAR_M: Final = 1.1
"""A point of a surface nearer than this can hold an agent: d_s plus the reach of the lines."""
MIN_LAG_M: Final = 1.5
"""An agent nearer to its slot than this passes an obstacle on its way; it is not held by it."""
LEANS: Final = 0.02
"""Sine of the angle between the way and the line to a point from which the way leans to a side."""
SIDE_S: Final = 5.0
"""How long one side of an obstacle is tried."""
STANDS_M: Final = 0.1
"""An agent that has not moved so far stands [m]."""
STANDS_S: Final = 4.0
"""An agent that has stood so long by a vehicle backs off."""
BACK_S: Final = 2.0
"""How long it backs off."""
BACK: Final = 2.0
"""Length of the way back: the way to the target, of 1 at most, is taken off it."""


class DeadlockEscape:
    """Watches one agent's progress towards its target, and finds a way out of a deadlock."""

    def __init__(self, own_id: int) -> None:
        self._own_id = own_id
        self._target: Vector | None = None
        self._nearest_m = 0.0
        self._since_s = 0.0
        self._past: Vector | None = None
        """Where it goes past a vehicle, of unit length [world axes]."""
        self._side: Vector | None = None
        self._side_s = 0.0
        self._stood_at: Vector = ZERO
        self._stood_s = 0.0
        """Where it stands on its way, and since when [s]."""

    @property
    def rounds_obstacle(self) -> bool:
        """Whether the agent goes round an obstacle."""
        return self._side is not None

    def direction(self, senses: Senses, target: Vector) -> Vector | None:
        """Return the vector of the escape [world axes]; None where nothing holds the agent.

        target [m; world frame]. Its length is 1, or BACK where the agent backs off.
        """
        if self._is_free(senses, target):
            self._past = self._side = None
            self._stood_at, self._stood_s = senses.position, senses.now_s
            return None
        if senses.now_s - self._since_s < PATIENCE_S:
            return None
        if self._backs_off(senses):
            return _way_back(senses.vehicles)
        way = _way(senses.position, target)
        vehicle = _nearest_ahead(way, senses.vehicles, VEHICLE_NEAR_M)
        if vehicle is None:
            self._past = None
            lags = self._side is not None or apart(senses.position, target) > MIN_LAG_M
            return self._round_obstacle(senses, way) if lags else None
        self._past = _across(self._past or self._first_way_past(senses, vehicle), vehicle)
        return self._past

    def _backs_off(self, senses: Senses) -> bool:
        """Whether it has stood on its way for so long that it backs off for a while."""
        standing_s = senses.now_s - self._stood_s
        if standing_s > STANDS_S + BACK_S or (
            standing_s <= STANDS_S and apart(senses.position, self._stood_at) > STANDS_M
        ):
            self._stood_at, self._stood_s = senses.position, senses.now_s
            return False
        return standing_s > STANDS_S

    def _is_free(self, senses: Senses, target: Vector) -> bool:
        """Whether the agent has arrived or has a new target; notes its progress."""
        away_m = apart(senses.position, target)
        before, self._target = self._target, target
        if before is None or away_m < ARRIVED_M or apart(before, target) > NEW_TARGET_M:
            self._nearest_m, self._since_s = away_m, senses.now_s
            return True
        if target != before:
            self._nearest_m += away_m - apart(senses.position, before)
        if away_m < self._nearest_m - PROGRESS_M:
            self._nearest_m = away_m
            if self._past is None and self._side is None:
                self._since_s = senses.now_s
        return False

    def _round_obstacle(self, senses: Senses, way: Vector) -> Vector | None:
        """Return the unit vector along the surface that is in the way; None if there is none."""
        point = _nearest_ahead(way, senses.obstacles, SURFACE_NEAR_M)
        if point is None:
            self._side = None
            return None
        if self._side is None:
            self._side, self._side_s = _first_side(way, point), senses.now_s
        elif senses.now_s - self._side_s > SIDE_S:
            self._side, self._side_s = _next_side(self._side, point), senses.now_s
        return _across(self._side, point)

    def _first_way_past(self, senses: Senses, vehicle: Vector) -> Vector:
        """Return where to begin to pass a vehicle: two that hold each other begin opposite ways."""
        away_m, aside_m = hypot(*vehicle), hypot(vehicle[0], vehicle[1])
        if abs(vehicle[2]) >= STEEP * away_m:
            if aside_m > LEVEL * away_m:
                return (-vehicle[0] / aside_m, -vehicle[1] / aside_m, 0.0)
            return (1.0 if self._comes_first(senses, vehicle) else -1.0, 0.0, 0.0)
        if abs(vehicle[2]) > LEVEL * away_m:
            return (0.0, 0.0, -1.0 if vehicle[2] > 0.0 else 1.0)
        return (0.0, 0.0, 1.0 if self._comes_first(senses, vehicle) else -1.0)

    def _comes_first(self, senses: Senses, vehicle: Vector) -> bool:
        """Whether the own id is lower than that of a vehicle, or that is of nobody known."""
        x, y, z = senses.position
        there = (x + vehicle[0], y + vehicle[1], z + vehicle[2])
        other = _neighbour_at(there, senses.neighbours)
        return other is None or self._own_id < other


def _way(position: Vector, target: Vector) -> Vector:
    """Return the unit vector from a position to a target."""
    x, y, z = target[0] - position[0], target[1] - position[1], target[2] - position[2]
    away = max(hypot(x, y, z), 1e-9)
    return (x / away, y / away, z / away)


def _way_back(vehicles: Sequence[Vector]) -> Vector | None:
    """Return the vector away from the nearest vehicle, of length BACK; None if none is near."""
    nearest = min(vehicles, key=lambda each: hypot(*each), default=None)
    if nearest is None or not 0.0 < hypot(*nearest) < VEHICLE_NEAR_M:
        return None
    x, y, z = _way(ZERO, nearest)
    return (-BACK * x, -BACK * y, -BACK * z)


def _nearest_ahead(way: Vector, points: Sequence[Vector], near_m: float) -> Vector | None:
    """Return the nearest point in the way; points are relative to the vehicle [m]."""
    x, y, z = way
    in_way = [
        point
        for point in points
        if 0.0 < (r := hypot(*point)) < near_m
        and x * point[0] + y * point[1] + z * point[2] > AHEAD * r
    ]
    return min(in_way, key=lambda point: hypot(*point), default=None)


def _neighbour_at(there: Vector, neighbours: Sequence[Heard]) -> int | None:
    """Return the id of the neighbour at a position [m; world frame]; None if there is none."""
    near = [other for other in neighbours if dist(other.position, there) < SAME_MEMBER_M]
    return min(near, key=lambda other: dist(other.position, there)).id if near else None


def _first_side(way: Vector, point: Vector) -> Vector:
    """Return the side of a point to which the way leans; up where it does not lean."""
    n = _way(ZERO, point)
    along = n[0] * way[0] + n[1] * way[1] + n[2] * way[2]
    lean = (way[0] - along * n[0], way[1] - along * n[1], way[2] - along * n[2])
    if hypot(*lean) > LEANS:
        return lean
    return (0.0, 0.0, 1.0) if abs(n[2]) < STEEP else (1.0, 0.0, 0.0)


def _next_side(side: Vector, point: Vector) -> Vector:
    """Return the side to try next: a quarter turn about the line to the point."""
    n, t = _way(ZERO, point), _across(side, point)
    return (n[1] * t[2] - n[2] * t[1], n[2] * t[0] - n[0] * t[2], n[0] * t[1] - n[1] * t[0])


def _across(direction: Vector, point: Vector) -> Vector:
    """Return the unit vector across the line to a point that is nearest to a direction."""
    n = _way(ZERO, point)
    along = n[0] * direction[0] + n[1] * direction[1] + n[2] * direction[2]
    t = (
        direction[0] - along * n[0],
        direction[1] - along * n[1],
        direction[2] - along * n[2],
    )
    length = max(hypot(*t), 1e-9)
    return (t[0] / length, t[1] / length, t[2] / length)
