"""The target's frame on its path: a pure function of time, the same for all agents that know it.

The origin flies from waypoint to waypoint at constant speed. At each waypoint it waits as long as
the path says. If the frame's yaw follows the path, the frame turns there on the spot, at the path's
own rate, before it goes on; so no slot has to move faster than a vehicle can.
"""

from bisect import bisect_right
from itertools import pairwise
from math import atan2, dist, hypot, inf, remainder, tau
from typing import Final, NamedTuple

from agent.messages import ZERO, FramePath, Vector
from agent.qstructure.target_frame import Frame

LEVEL_M: Final = 1e-6
"""A leg shorter than this horizontally has no azimuth: the frame keeps its yaw."""


class _Segment(NamedTuple):
    """A part of the path with constant velocities."""

    from_s: float  # its start [s]
    origin: Vector  # at its start [m; world frame]
    yaw: float  # at its start [rad]
    velocity: Vector = ZERO  # [m/s; world frame]
    yaw_rate: float = 0.0  # [rad/s]

    def at(self, time_s: float) -> Frame:
        """Return the frame at a time [s] within this segment."""
        t = time_s - self.from_s
        (x, y, z), (u, v, w) = self.origin, self.velocity
        return Frame(
            (x + t * u, y + t * v, z + t * w),
            self.yaw + t * self.yaw_rate,
            self.velocity,
            self.yaw_rate,
        )


class Track:
    """The frame along a path. rests: whether it never moves; arrives_s: when it stops [s]."""

    def __init__(self, path: FramePath) -> None:
        self._segments = _segments(path)
        self._from_s = [each.from_s for each in self._segments]
        self._first = Frame(self._segments[0].origin, self._segments[0].yaw)
        self.rests = len(self._segments) == 1
        self.arrives_s = self._from_s[-1]

    def at(self, time_s: float) -> Frame:
        """Return the frame at a time [s; Observation time]."""
        if self.rests or time_s < self._from_s[0]:
            return self._first
        return self._segments[bisect_right(self._from_s, time_s) - 1].at(time_s)

    def stretches(self) -> list[tuple[float, float, Frame]]:
        """Return the path's parts with constant velocities in order, without the final rest.

        Each with its start and its end [s], and the frame at its start.
        """
        return [
            (each.from_s, until_s, each.at(each.from_s))
            for each, until_s in zip(self._segments, self._from_s[1:], strict=False)
        ]


def _segments(path: FramePath) -> list[_Segment]:
    """Return the path's segments in order of time; in the last one the frame rests for good."""
    headings = _headings(path)
    time_s, yaw = path.start_s, headings[0]
    found = []
    for index, here in enumerate(path.waypoints):
        wait_s = path.waits_s[index] if index < len(path.waits_s) else 0.0
        if wait_s > 0.0:
            found.append(_Segment(time_s, here, yaw))
            time_s += wait_s
        if index + 1 == len(path.waypoints):
            break
        turn = headings[index] - yaw
        if turn != 0.0:
            rate = path.turn_rate if turn > 0.0 else -path.turn_rate
            found.append(_Segment(time_s, here, yaw, ZERO, rate))
            time_s, yaw = time_s + turn / rate, headings[index]
        there = path.waypoints[index + 1]
        lasts_s = dist(here, there) / path.speed
        velocity = _velocity(here, there, path.speed)
        found.append(_Segment(time_s, here, yaw, velocity))
        time_s += lasts_s
    return [*found, _Segment(time_s, path.waypoints[-1], yaw)]


def _velocity(here: Vector, there: Vector, speed: float) -> Vector:
    scale = speed / max(dist(here, there), LEVEL_M)
    x, y, z = (b - a for a, b in zip(here, there, strict=True))
    return (scale * x, scale * y, scale * z)


def _headings(path: FramePath) -> list[float]:
    """Return the frame's yaw on each leg [rad], turned the short way from leg to leg."""
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
    """Return the speed of a slot ``reach_m`` [m] off the axis while the frame turns [m/s]."""
    turns = any(each.yaw_rate != 0.0 for each in _segments(path))
    return path.turn_rate * reach_m if turns else 0.0


def ends_s(path: FramePath) -> float:
    """Return the time at which the frame comes to rest for good [s]; -inf if it never moves."""
    track = Track(path)
    return -inf if track.rests else track.arrives_s
