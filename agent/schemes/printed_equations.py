"""The paper's equations as printed: the bobber of Algorithm 2, and the potentials (18)-(28).

docs/method.md lists what is wrong with them, by the numbers used here.
"""

from math import acos, cos, dist, exp, hypot, inf, pi, sin
from typing import Final, NamedTuple

from agent.controller import Heard
from agent.guidance.cone import Cone, azimuth_error
from agent.messages import Vector

A_T: Final = 1.0
"""a_t of (23)."""
ELEVATION: Final = pi / 4.0
"""theta_3, theta_4 of (5) [rad]."""
LEAST_U: Final = 1e-9
MAX_EXPONENT: Final = 700.0
HALVINGS: Final = 8
"""How often the bobber's step is halved before it counts as at rest."""


class CastZone(NamedTuple):
    """The cast-zone of Fig. 5."""

    near_m: float  # d_c1
    far_m: float  # d_c2
    cone: Cone


def bobber(q: Vector, yaw: float, q_toq: Vector, zone: CastZone) -> Vector:
    """Return where the bobber comes to rest: Algorithm 2 at unit weight [m; world frame].

    It starts on the axis (Sec. 3.3) and goes down (1)-(3) in spherical coordinates.
    """
    v = (q_toq[0] - q[0], q_toq[1] - q[1], q_toq[2] - q[2])
    away, level = hypot(*v), hypot(v[0], v[1])
    error = azimuth_error(v[0], v[1], yaw)
    passes = zone.cone.holds(error) and abs(v[2]) <= level
    if passes and zone.near_m < away < zone.far_m:
        return q_toq
    best = (0.5 * (zone.near_m + zone.far_m), 0.0, 0.0)
    least = _cast_potential(best, v, yaw, zone, passes)
    steps = (0.25 * (zone.far_m - zone.near_m), 0.25, 0.25)
    for halving in range(HALVINGS):
        moved = True
        while moved:
            moved = False
            for axis in range(3):
                for side in (-1.0, 1.0):
                    step = [0.0, 0.0, 0.0]
                    step[axis] = side * steps[axis] * 0.5**halving
                    other = (best[0] + step[0], best[1] + step[1], best[2] + step[2])
                    value = _cast_potential(other, v, yaw, zone, passes)
                    if value < least:
                        best, least, moved = other, value, True
    return _at(q, best, yaw)


def _cast_potential(at: Vector, v: Vector, yaw: float, zone: CastZone, passes: bool) -> float:
    """Return U_tcast + U_obcast of a bobber at (r, azimuth, elevation) off the axis: (1)-(5).

    v: from the vehicle to its target [m; world axes]; passes: whether line 3 holds.
    """
    r, side, up = at
    ahead = cos(up) * cos(side)
    walls = (
        r * cos(up) * sin(zone.cone.left - side),
        r * cos(up) * sin(zone.cone.right + side),
        r * (ahead * sin(ELEVATION) - sin(up) * cos(ELEVATION)),
        r * (ahead * sin(ELEVATION) + sin(up) * cos(ELEVATION)),
    )
    if not zone.near_m < r < zone.far_m or min(walls) <= 0.0:
        return inf
    fences = 0.5 / (r - zone.near_m) ** 2 + 0.5 / (r - zone.far_m) ** 2
    fences += sum(1.0 / wall for wall in walls)
    b = _at((0.0, 0.0, 0.0), at, yaw)
    onward = (v[0] - b[0], v[1] - b[1], v[2] - b[2])
    left_m = hypot(*onward)
    if passes:
        return 0.5 * left_m + fences
    inner = b[0] * onward[0] + b[1] * onward[1] + b[2] * onward[2]
    return acos(max(-1.0, min(1.0, inner / max(r * left_m, LEAST_U)))) + fences


def _at(q: Vector, at: Vector, yaw: float) -> Vector:
    r, side, up = at
    flat = r * cos(up)
    return (q[0] + flat * cos(yaw + side), q[1] + flat * sin(yaw + side), q[2] + r * sin(up))


def omega(q: Vector, q_tg: Vector, others: tuple[Heard, ...], d_ob: float) -> Vector:
    """Return Omega_i of (27) as printed, with the slope of (23) on both sides [m; world frame]."""
    x, y, z = q[0] - q_tg[0], q[1] - q_tg[1], q[2] - q_tg[2]
    for other in others:
        p = other.position
        u = 0.5 * (dist(q, p) - d_ob) ** 2
        push = slope(u, 0.5 * dist(q_tg, other.target) ** 2)
        x += push * (q[0] - p[0])
        y += push * (q[1] - p[1])
        z += push * (q[2] - p[2])
    return (x, y, z)


def slope(u: float, u_tg: float) -> float:
    """Return dU_ob/dU of (23)."""
    u, u_tg = max(u, LEAST_U), max(u_tg, LEAST_U)
    d = u - u_tg
    sigma = 1.0 / (1.0 + exp(max(-MAX_EXPONENT, min(MAX_EXPONENT, A_T * d * d * d))))
    h, steepness = u / u_tg**2 + 1.0 / u, 1.0 / u_tg**2 - 1.0 / u**2
    return sigma * steepness - 3.0 * A_T * d * d * sigma * (1.0 - sigma) * h
