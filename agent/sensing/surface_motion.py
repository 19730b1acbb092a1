"""Which surfaces near by come nearer by themselves, from successive readings of the nearest points.

A nearest point moves with the surface, and along it as the vehicle flies past. Between two readings
a surface that stands moves it by nothing along the mean of the two directions away from it, be it
plane, edge or ball: what is left is the surface's own speed along the line to the vehicle. As that
line turns, reading by reading, the whole velocity comes out.
"""

from collections.abc import Sequence
from math import dist, sqrt
from typing import NamedTuple

from agent.messages import ZERO, Vector

SAME_POINT_M = 0.3
"""Nearer than this to the point before, it is on the same surface."""
LOST_S = 0.3
"""After so long without a reading nothing is known of how points move."""
LEAST_MPS = 0.02
SMOOTHING_S = 0.5
SURE = 3.0
"""Standard deviations of the noise's speed below which a point is taken to stand."""


class _Seen(NamedTuple):
    """A nearest point [m; world frame], the unit vector from it to the vehicle, its velocity [m/s].

    Of the velocity only what readings have shown is known; the rest is taken for zero.
    """

    at: Vector
    away: Vector
    velocity: Vector


class Motion:
    """Watches the nearest points that one agent senses; noise_m: of each reading, per axis [m].

    Without noise the last two readings tell; with it, the mean of about half a second.
    """

    def __init__(self, noise_m: float) -> None:
        self._smooths = noise_m > 0.0
        self._least = LEAST_MPS + SURE * noise_m / SMOOTHING_S
        self._seen: list[_Seen] = []
        self._seen_s = 0.0

    def coming(self, now_s: float, here: Vector, points: Sequence[Vector]) -> tuple[Vector, ...]:
        """Return the velocity of each point's surface that comes nearer by itself [m/s].

        here [m; world frame]; points: relative to it [m; world axes]. Zero for what stands or goes;
        empty if nothing comes.
        """
        dt = now_s - self._seen_s
        before = self._seen if 0.0 < dt <= LOST_S else []
        self._seen = [self._look(here, point, before, dt) for point in points]
        self._seen_s = now_s
        if all(dot(seen.velocity, seen.away) <= self._least for seen in self._seen):
            return ()
        return tuple(
            seen.velocity if dot(seen.velocity, seen.away) > self._least else ZERO
            for seen in self._seen
        )

    def _look(self, here: Vector, point: Vector, before: Sequence[_Seen], dt: float) -> _Seen:
        x, y, z = point
        r = max(sqrt(x * x + y * y + z * z), 1e-9)
        at, away = (here[0] + x, here[1] + y, here[2] + z), (-x / r, -y / r, -z / r)
        last = min(before, key=lambda seen: dist(seen.at, at), default=None)
        if last is None or dist(last.at, at) > SAME_POINT_M:
            return _Seen(at, away, ZERO)
        missed = _came_nearer(last, at, away) / dt - dot(last.velocity, away)
        if self._smooths:
            missed *= min(1.0, dt / SMOOTHING_S)
        u, v, w = last.velocity
        velocity = (u + missed * away[0], v + missed * away[1], w + missed * away[2])
        return _Seen(at, away, velocity)


def dot(a: Vector, b: Vector) -> float:
    """Return the scalar product of two vectors."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def _came_nearer(last: _Seen, at: Vector, away: Vector) -> float:
    """Return by how much a surface came nearer [m], along the mean direction to the vehicle."""
    return 0.5 * sum(
        (b - a) * (n + m) for a, b, n, m in zip(last.at, at, last.away, away, strict=True)
    )
