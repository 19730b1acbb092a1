"""The safety filter: the last step before the vehicle, independent of why a velocity is wanted.

It has two forms. This one is for vehicles with a ranging sensor, and for surfaces;
promise_filter.py is for vehicles without one. The approach speed towards each sensed vehicle is
limited by the remaining gap. Each vehicle of a pair may close only its own share of the gap, so the
gap never closes, whatever the phases of their steps and with a command's whole life as latency. A
margin covers that the direction between two vehicles turns while a command is flown. Within the
margin the speed across is limited too, or two vehicles that circle each other could use the margin
up little by little. Noise of the sensor has a margin of its own.

H is the longest time from a measurement to the expiry of the command made from it [s].
"""

from collections.abc import Sequence
from math import hypot, inf, sqrt
from typing import Final, NamedTuple

from agent.guidance.cone import Cone, azimuth_error
from agent.guidance.movement import DEAD_BAND_MPS, SURELY
from agent.messages import ZERO, Vector
from agent.vectors import across

SHARE: Final = 0.18
"""Share of the gap that one vehicle of a pair may close within H: 2 * SHARE <= 1/e."""
PASSES: Final = 3
LEAST_EVADING_S: Final = 1e-9
INNER_SHARE: Final = 0.7
"""Share of the margin for noise within which a vehicle only flies away: noise turns the measured
line to the other vehicle, and a speed across that line is then a speed towards it."""
LEAVING: Final = 0.5
"""Speed across, in speeds away, that a vehicle within that share may fly: a straight way back may
not be open to it. It still leaves if the measured line is turned by 63 degrees."""
SURE_OF_LINE: Final = 0.7
"""Margin for noise, in least distances, up to which noise turns that line by 45 degrees at most."""
ROUNDING_MPS: Final = 1e-12
"""Tolerance: a velocity that slides along a limit of zero exceeds it by rounding."""


class Bound(NamedTuple):
    """The limits that one vehicle or surface sets to the velocity.

    A negative limit asks for a retreat: from a surface that approaches by itself, or that noise or
    a motion too slow to notice has brought too near.
    """

    away: Vector  # unit vector away from the vehicle or surface [world axes]
    limit: float  # of the speed towards it [m/s]
    across_limit: float = inf  # of the speed across the line to it [m/s]
    leaving: float = 0.0  # how much the speed away adds to the limit across
    surface_velocity: Vector = ZERO  # of an approaching surface [m/s; world axes]


class Margins(NamedTuple):
    """How a filter's law is adapted to a kind of vehicle, and to what a sensor leaves unknown."""

    share: float = SHARE
    """Share of the gap that may be closed within H; 2 * SHARE for what does not move."""
    noise_m: float = 0.0
    """Measured distances may be too long by this much [m]."""
    creep: float = 0.0
    """Speed across that is always allowed [m/s]: noise must not hold a vehicle before a surface."""
    retreats: bool = False
    """Whether the vehicle retreats from what is too near, as fast as it may approach."""
    unnoticed_mps: float = 0.0
    """Speed of approach that is taken for rest [m/s]; the retreat must outrun it."""
    evading_s: float = 0.0
    """Time in which a vehicle evades an approaching surface; it begins so much earlier [s]."""
    latency_s: float | None = None
    """H without the braking time [s]; None: H."""


EXACT = Margins()


class RangingFilter:
    """Limits the approach speed by the gap to each sensed vehicle or point.

    d_ob: least distance between centres [m]; max_speed: of any vehicle [m/s]; horizon_s: H.
    """

    def __init__(
        self, d_ob: float, max_speed: float, horizon_s: float, margins: Margins = EXACT
    ) -> None:
        latency_s = horizon_s if margins.latency_s is None else margins.latency_s
        reach = max_speed * latency_s
        turning_m = d_ob + margins.noise_m
        self._max_speed = max_speed
        self._inner_m = d_ob + INNER_SHARE * margins.noise_m
        self._leaving = LEAVING if margins.noise_m <= SURE_OF_LINE * d_ob else 0.0
        margin_m = reach * reach / turning_m
        self._rate = margins.share / horizon_s
        if margins.retreats:
            margin_m = max(margin_m, margins.unnoticed_mps / self._rate)
        self._stop_m = turning_m + margin_m
        self._turning_hz = max_speed / (self._stop_m - self._inner_m)
        self._evading_rate = min(self._rate, 1.0 / max(margins.evading_s, LEAST_EVADING_S))
        self._retreats = margins.retreats
        self._creep = margins.creep
        self._ignore_m = self._stop_m + max_speed / self._rate

    def bounds(self, points: Sequence[Vector]) -> list[Bound]:
        """Return the bounds of vehicles or points at relative positions [m; world axes]."""
        found = []
        for x, y, z in points:
            r = sqrt(x * x + y * y + z * z)
            if r >= self._ignore_m or r == 0.0:
                continue
            gap = r - self._stop_m
            limit = self._rate * (gap if self._retreats else max(0.0, gap))
            turning = self._turning_hz * max(0.0, r - self._inner_m)
            across_limit = max(self._creep, turning) if r < self._stop_m else inf
            leaving = self._leaving if r < self._inner_m else 0.0
            found.append(Bound((-x / r, -y / r, -z / r), limit, across_limit, leaving))
        return found

    def bounds_of_moving(
        self, points: Sequence[Vector], velocities: Sequence[Vector]
    ) -> list[Bound]:
        """Return the bounds of points of which some approach by themselves.

        velocities: of the points' surfaces [m/s; world axes]; zero for a surface at rest. An
        approaching surface keeps no share of its own, so its speed counts whole: -n.v <= share
        gap/H - n.v_surface. Where that is negative, the speed across is not limited.
        """
        found = []
        for (x, y, z), (u, v, w) in zip(points, velocities, strict=True):
            r = max(hypot(x, y, z), 1e-9)
            speed = -(x * u + y * v + z * w) / r
            limit = self._evading_rate * (r - self._stop_m) - speed
            if speed <= 0.0:
                found += self.bounds([(x, y, z)])
            elif limit < self._max_speed:
                away = (-x / r, -y / r, -z / r)
                found.append(Bound(away, limit, surface_velocity=(u, v, w)))
        return found


def limited(velocity: Vector, bounds: Sequence[Bound], yaw: float, cone: Cone) -> Vector:
    """Return a velocity that keeps every bound [m/s].

    It first slides along the bounds that it breaks, and is shortened if it is still too fast. A
    slide that leaves the cone about ``yaw`` [rad] is not flown; then the result is the faster one
    of its climb alone and of the velocity merely shortened.
    """
    if all(_keeps(velocity, bound) for bound in bounds):
        return velocity
    sliding = _slid_along(velocity, bounds)
    if _in_cone(sliding, yaw, cone):
        return _scaled_down(sliding, bounds)
    climbing = _scaled_down((0.0, 0.0, sliding[2]), bounds)
    return max(climbing, _scaled_down(velocity, bounds), key=lambda v: hypot(*v))


def slid(velocity: Vector, bounds: Sequence[Bound]) -> Vector:
    """Return a velocity slid along every bound; it keeps those that are not negative [m/s]."""
    firm = [each for each in bounds if each.limit >= 0.0]
    return _scaled_down(_slid_along(velocity, bounds), firm)


def shortened(velocity: Vector, max_speed: float) -> Vector:
    """Return a velocity no faster than ``max_speed`` [m/s], in the same direction."""
    x, y, z = velocity
    if x * x + y * y + z * z < SURELY * max_speed * max_speed:
        return velocity
    speed = hypot(x, y, z)
    if speed <= max_speed:
        return velocity
    scale = max_speed / speed
    return (x * scale, y * scale, z * scale)


def _slid_along(velocity: Vector, bounds: Sequence[Bound]) -> Vector:
    for _ in range(PASSES):
        for bound in bounds:
            if not _keeps(velocity, bound):
                velocity = _cut(velocity, bound)
    return velocity


def _keeps(velocity: Vector, bound: Bound) -> bool:
    if bound.across_limit < inf and _across(velocity, bound) > bound.across_limit + ROUNDING_MPS:
        return False
    return approach_of(velocity, bound) <= bound.limit + ROUNDING_MPS


def _cut(velocity: Vector, bound: Bound) -> Vector:
    """Return a velocity whose parts towards and across the bound are cut to its limits [m/s]."""
    n, approach = bound.away, approach_of(velocity, bound)
    kept, share = -min(approach, bound.limit), 1.0
    if bound.across_limit < inf:
        share = min(1.0, bound.across_limit / max(_across(velocity, bound), 1e-12))
    return (
        share * (velocity[0] + approach * n[0]) + kept * n[0],
        share * (velocity[1] + approach * n[1]) + kept * n[1],
        share * (velocity[2] + approach * n[2]) + kept * n[2],
    )


def _scaled_down(velocity: Vector, bounds: Sequence[Bound]) -> Vector:
    """Return a velocity scaled down until it keeps every bound [m/s]."""
    scale = 1.0
    for bound in bounds:
        approach = approach_of(velocity, bound)
        if approach * scale > bound.limit + ROUNDING_MPS:
            scale = bound.limit / approach
        across = _across(velocity, bound) if bound.across_limit < inf else 0.0
        if across * scale > bound.across_limit + ROUNDING_MPS:
            scale = bound.across_limit / across
    return (velocity[0] * scale, velocity[1] * scale, velocity[2] * scale)


def _across(velocity: Vector, bound: Bound) -> float:
    """Return the speed across the line to a bound's vehicle or surface [m/s]."""
    n, approach = bound.away, approach_of(velocity, bound)
    return hypot(
        velocity[0] + approach * n[0], velocity[1] + approach * n[1], velocity[2] + approach * n[2]
    )


def approach_of(velocity: Vector, bound: Bound) -> float:
    """Return the speed towards a bound's vehicle or surface [m/s]."""
    n = bound.away
    return -(velocity[0] * n[0] + velocity[1] * n[1] + velocity[2] * n[2])


def _in_cone(velocity: Vector, yaw: float, cone: Cone) -> bool:
    if across(velocity) <= DEAD_BAND_MPS:
        return True
    return cone.holds(azimuth_error(velocity[0], velocity[1], yaw))
