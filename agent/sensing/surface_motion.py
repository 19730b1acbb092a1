"""Surface motion: the velocity of approaching surfaces, from successive nearest points.

A nearest point moves with its surface, and along it as the vehicle flies past. Along the mean of
the two directions from the surface to the vehicle, a surface at rest does not move its nearest
point between two readings, be it plane, edge or ball. What remains is the surface's own speed
along the line to the vehicle. As that line turns, the readings together give the whole velocity.
"""

from collections.abc import Sequence
from math import dist, sqrt
from typing import Final, NamedTuple

from agent.messages import ZERO, Vector

SAME_SURFACE_M: Final = 0.3
"""A point nearer than this to a point of the last reading is on the same surface."""
LOST_S: Final = 0.3
"""After a longer pause without a reading, nothing is known of how points move."""
LEAST_MPS: Final = 0.006
"""A surface slower than this counts as at rest [m/s]: the edges of one at rest seem to move so."""
SMOOTHING_S: Final = 0.5
SURE: Final = 3.0
"""A surface slower than so many standard deviations of the noise's speed counts as at rest."""


class _SurfacePoint(NamedTuple):
    """A nearest point of a surface."""

    at: Vector  # [m; world frame]
    away: Vector  # unit vector from the point to the vehicle [world frame]
    velocity: Vector  # as far as readings have shown it; the rest is zero [m/s; world frame]


class SurfaceMotion:
    """Watches the nearest points that one agent senses. noise_m: of a reading, per axis [m].

    Without noise it uses the last two readings; with noise, the mean of about half a second.
    """

    def __init__(self, noise_m: float) -> None:
        self._smooths = noise_m > 0.0
        self._least = LEAST_MPS + SURE * noise_m / SMOOTHING_S
        self._points: list[_SurfacePoint] = []
        self._read_s = 0.0

    def approaching(
        self, now_s: float, here: Vector, points: Sequence[Vector]
    ) -> tuple[Vector, ...]:
        """Return the velocity of each point's surface [m/s]; zero unless it approaches by itself.

        here [m; world frame]; points: relative to it [m; world axes]. Empty if none approaches.
        """
        dt = now_s - self._read_s
        before = self._points if 0.0 < dt <= LOST_S else []
        self._points = [self._updated(here, point, before, dt) for point in points]
        self._read_s = now_s
        if all(dot(each.velocity, each.away) <= self._least for each in self._points):
            return ()
        return tuple(
            each.velocity if dot(each.velocity, each.away) > self._least else ZERO
            for each in self._points
        )

    def _updated(
        self, here: Vector, point: Vector, before: Sequence[_SurfacePoint], dt: float
    ) -> _SurfacePoint:
        x, y, z = point
        r = max(sqrt(x * x + y * y + z * z), 1e-9)
        at, away = (here[0] + x, here[1] + y, here[2] + z), (-x / r, -y / r, -z / r)
        last = min(before, key=lambda each: dist(each.at, at), default=None)
        if last is None or dist(last.at, at) > SAME_SURFACE_M:
            return _SurfacePoint(at, away, ZERO)
        missed = _came_nearer(last, at, away) / dt - dot(last.velocity, away)
        if self._smooths:
            missed *= min(1.0, dt / SMOOTHING_S)
        u, v, w = last.velocity
        velocity = (u + missed * away[0], v + missed * away[1], w + missed * away[2])
        return _SurfacePoint(at, away, velocity)


def dot(a: Vector, b: Vector) -> float:
    """Return the scalar product of two vectors."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def _came_nearer(last: _SurfacePoint, at: Vector, away: Vector) -> float:
    """Return by how much a surface came nearer [m], along the mean direction to the vehicle."""
    return 0.5 * sum(
        (b - a) * (n + m) for a, b, n, m in zip(last.at, at, last.away, away, strict=True)
    )
