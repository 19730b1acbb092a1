"""Where the target's frame is on its path: a pure function of time, the same for all who know it.

The origin flies from waypoint to waypoint at constant speed. At each it waits as long as the path
says, and where the frame's yaw follows the path it turns there on the spot, at the path's own rate,
before it goes on: so no slot ever has to move faster than a vehicle can.
"""

from bisect import bisect_right
from itertools import pairwise
from math import atan2, dist, hypot, inf, remainder, tau
from typing import NamedTuple

from agent.messages import ZERO, FramePath, Vector
from agent.qstructure.target_frame import Frame

LEVEL_M = 1e-6
"""A leg that goes less far than this horizontally has no azimuth: the frame keeps its yaw."""


class _Stretch(NamedTuple):
    """A time of constant velocities: from ``from_s`` [s], beginning where the frame is then."""

    from_s: float
    origin: Vector
    yaw: float
    velocity: Vector = ZERO
    yaw_rate: float = 0.0

    def at(self, time_s: float) -> Frame:
        """Return the frame at a time [s] within this stretch."""
        t = time_s - self.from_s
        (x, y, z), (u, v, w) = self.origin, self.velocity
        return Frame(
            (x + t * u, y + t * v, z + t * w),
            self.yaw + t * self.yaw_rate,
            self.velocity,
            self.yaw_rate,
        )


class Track:
    """A path as it is flown. ``rests``: whether it never moves at all."""

    def __init__(self, path: FramePath) -> None:
        self._stretches = _stretches(path)
        self._from_s = [each.from_s for each in self._stretches]
        self._first = Frame(self._stretches[0].origin, self._stretches[0].yaw)
        self.rests = len(self._stretches) == 1
        self.arrives_s = self._from_s[-1]

    def at(self, time_s: float) -> Frame:
        """Return the frame at a time [s; of Observations]."""
        if self.rests or time_s < self._from_s[0]:
            return self._first
        return self._stretches[bisect_right(self._from_s, time_s) - 1].at(time_s)


def _stretches(path: FramePath) -> list[_Stretch]:
    """Return the path's stretches in order of time; the last one rests for ever."""
    headings = _headings(path)
    time_s, yaw = path.start_s, headings[0]
    found = []
    for index, here in enumerate(path.waypoints):
        wait_s = path.waits_s[index] if index < len(path.waits_s) else 0.0
        if wait_s > 0.0:
            found.append(_Stretch(time_s, here, yaw))
            time_s += wait_s
        if index + 1 == len(path.waypoints):
            break
        turn = headings[index] - yaw
        if turn != 0.0:
            rate = path.turn_rate if turn > 0.0 else -path.turn_rate
            found.append(_Stretch(time_s, here, yaw, ZERO, rate))
            time_s, yaw = time_s + turn / rate, headings[index]
        there = path.waypoints[index + 1]
        lasts_s = dist(here, there) / path.speed
        velocity = _velocity(here, there, path.speed)
        found.append(_Stretch(time_s, here, yaw, velocity))
        time_s += lasts_s
    return [*found, _Stretch(time_s, path.waypoints[-1], yaw)]


def _velocity(here: Vector, there: Vector, speed: float) -> Vector:
    scale = speed / max(dist(here, there), LEVEL_M)
    x, y, z = (b - a for a, b in zip(here, there, strict=True))
    return (scale * x, scale * y, scale * z)


def _headings(path: FramePath) -> list[float]:
    """Return the frame's yaw on each leg [rad], each turned the short way from the one before."""
    yaw = path.yaw
    if path.turn_rate == 0.0:
        return [yaw] * len(path.waypoints)
    found: list[float] = []
    for here, there in pairwise(path.waypoints):
        x, y = there[0] - here[0], there[1] - here[1]
        before = found[-1] if found else path.yaw
        if hypot(x, y) > LEVEL_M:
            before += remainder(atan2(y, x) + path.yaw - before, tau)
        found.append(before)
    return found or [yaw]


def tip_speed(path: FramePath, reach_m: float) -> float:
    """Return the speed [m/s] of a slot ``reach_m`` [m] off the axis while the frame turns."""
    turns = any(each.yaw_rate != 0.0 for each in _stretches(path))
    return path.turn_rate * reach_m if turns else 0.0


def ends_s(path: FramePath) -> float:
    """Return when the frame comes to rest for good [s]; -inf where it never moves."""
    track = Track(path)
    return -inf if track.rests else track.arrives_s
