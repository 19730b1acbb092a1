"""Ray casting: the distance along each ray to the first obstacle or vehicle that it hits.

Only + - * / sqrt and comparisons act across rows here. A ray that starts inside a body hits it at
distance 0.
"""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from worldsim.truth.obstacles import Obstacles
from worldsim.truth.vehicle import Floats

PARALLEL: Final = 1e-12
"""A ray whose component across a face is smaller than this counts as parallel to the face."""
AT_ONCE: Final = 8192
"""So many pairs of a ray and a sphere are looked at together: they stay in a core's cache."""


def cast(origins: Floats, rays: Floats, obstacles: Obstacles, time_s: float) -> Floats:
    """Return the distance (P, K) [m] along rays to the first obstacle; infinite for none.

    origins: (P, 3) [m; world frame]; rays: (P, K, 3), unit vectors [world axes].
    """
    start = origins[:, None] - obstacles.centres(time_s)
    spheres = obstacles.spheres
    far = cast_at_spheres(start[:, spheres], rays, obstacles.radius[spheres])
    for columns, hit in ((obstacles.cylinders, _hit_cylinders), (obstacles.boxes, _hit_boxes)):
        for column in columns.tolist():
            solid = (obstacles.radius[column], obstacles.half[column], obstacles.heading[column])
            far = np.minimum(far, hit(start[:, None, column], rays, *solid))
    return far


def cast_at_spheres(start: Floats, rays: Floats, radius: Floats) -> Floats:
    """Return the distance (P, K) [m] along rays to the first of M spheres; infinite for none.

    start: (P, M, 3), the rays' origins relative to the centres [m]; NaN hits nothing. rays:
    (P, K, 3), unit vectors. radius: (M,) [m].
    """
    far = np.full(rays.shape[:2], np.inf)
    at_once = max(1, AT_ONCE // max(1, far.size))
    for first in range(0, start.shape[1], at_once):
        some = slice(first, first + at_once)
        hit = _hit_spheres(start[:, some, None], rays[:, None], radius[some, None])
        far = np.minimum(far, np.min(hit, axis=1))
    return far


def _hit_spheres(start: Floats, rays: Floats, radius: Floats) -> Floats:
    along = -_dot(start, rays)
    excess = _dot(start, start) - radius * radius
    square = along * along - excess
    root = np.sqrt(np.maximum(square, 0.0))
    hits = (square >= 0.0) & (along + root >= 0.0)
    return np.where(hits, np.maximum(along - root, 0.0), np.inf)


def _hit_cylinders(start: Floats, rays: Floats, radius: float, half: Floats, _: Floats) -> Floats:
    flat_start, flat_rays = start * (1.0, 1.0, 0.0), rays * (1.0, 1.0, 0.0)
    a, b = _dot(flat_rays, flat_rays), _dot(flat_start, flat_rays)
    excess = _dot(flat_start, flat_start) - radius * radius
    square = b * b - a * excess
    crosses = a > PARALLEL * PARALLEL
    root, level = np.sqrt(np.maximum(square, 0.0)), np.where(crosses, a, 1.0)
    upright = np.where(excess <= 0.0, np.inf, -np.inf)
    enter = np.where(crosses, (-b - root) / level, -upright)
    leave = np.where(crosses, (-b + root) / level, upright)
    low, high = _slab(start[..., 2], rays[..., 2], half[2])
    hits = (square >= 0.0) | ~crosses
    return _first(np.maximum(enter, low), np.minimum(leave, high), hits)


def _hit_boxes(start: Floats, rays: Floats, _: float, half: Floats, heading: Floats) -> Floats:
    c, s = heading.tolist()
    enter, leave = _slab(start[..., 2], rays[..., 2], half[2])
    for axis, (x, y) in enumerate(((c, s), (-s, c))):
        low, high = _slab(
            x * start[..., 0] + y * start[..., 1], x * rays[..., 0] + y * rays[..., 1], half[axis]
        )
        enter, leave = np.maximum(enter, low), np.minimum(leave, high)
    return _first(enter, leave, np.ones(enter.shape, dtype=np.bool_))


def _slab(start: Floats, way: Floats, half: float) -> tuple[Floats, Floats]:
    """Return the distances at which a ray enters and leaves the slab between faces at +-half [m].

    start, way: the ray's origin [m] and direction across the faces.
    """
    still = np.abs(way) < PARALLEL
    pace = np.where(still, 1.0, way)
    one, other = (-half - start) / pace, (half - start) / pace
    between = np.where(np.abs(start) <= half, np.inf, -np.inf)
    low = np.where(still, -between, np.minimum(one, other))
    high = np.where(still, between, np.maximum(one, other))
    return low, high


def _first(enter: Floats, leave: Floats, hits: NDArray[np.bool_]) -> Floats:
    sound = hits & (enter <= leave) & (leave >= 0.0)
    return np.where(sound, np.maximum(enter, 0.0), np.inf)


def _dot(a: Floats, b: Floats) -> Floats:
    total: Floats = a[..., 0] * b[..., 0] + a[..., 1] * b[..., 1] + a[..., 2] * b[..., 2]
    return total
