"""The safety filter: last before the vehicle, and independent of why a velocity was wanted.

Two forms. With a ranging sensor the approach speed towards each body sensed is limited by the gap
that is left; both vehicles of a pair keep to half of the duty, so the gap never closes, whatever
their phases and with a command's whole life as latency. A margin covers that the direction between
two turns while a command is flown; within it the speed across is limited too, or two that circle
each other could eat it up little by little. Without a ranging sensor, the limit follows from what
neighbours last told and from the speed they promised not to exceed.

H is the longest time from a measurement to the expiry of the command made from it [s].
"""

from collections import deque
from collections.abc import Sequence
from math import hypot, inf, sqrt
from typing import NamedTuple

from agent.guidance.cone import Cone, azimuth_error
from agent.guidance.movement import DEAD_BAND_MPS
from agent.messages import ZERO, Vector

SHARE = 0.18
"""Share of the gap that one vehicle of a pair may close within H: 2 * SHARE <= 1/e."""
STATIC = 2.0 * SHARE
"""Share for what stands still: nobody else closes the gap."""
PROMISE_S = 3.0
LEAST_CAP_MPS = 0.05
PASSES = 3
ROUNDING_MPS = 1e-12
"""What slides along a limit of zero exceeds it by rounding; that is no reason to stand still."""


class Bound(NamedTuple):
    """One body's limits: the speed towards it and the speed across [m/s].

    away: the unit vector away from the body. A negative limit asks for a retreat from what comes at
    ``coming`` [m/s; world axes] by itself.
    """

    away: Vector
    limit: float
    aside: float = inf
    coming: Vector = ZERO


class RangingFilter:
    """Limits approach by the gap to each body sensed.

    d_ob: least distance between centres [m]; max_speed [m/s]; horizon_s: H. share: of the gap, what
    may be closed within H; STATIC for what does not move itself. creep: how fast one may go across
    however near [m/s]: noise puts points nearer than they are, and must not hold one for ever.
    latency_s: H without the time to brake, which makes the margin; left out: horizon_s.
    """

    def __init__(
        self,
        d_ob: float,
        max_speed: float,
        horizon_s: float,
        share: float = SHARE,
        creep: float = 0.0,
        latency_s: float | None = None,
    ) -> None:
        reach = max_speed * (horizon_s if latency_s is None else latency_s)
        self._max_speed = max_speed
        self._d_ob = d_ob
        self._stop_m = d_ob + reach * reach / d_ob
        self._turning_hz = max_speed / (self._stop_m - d_ob)
        self._rate = share / horizon_s
        self._creep = creep
        self._ignore_m = self._stop_m + max_speed / self._rate

    def bounds(self, vehicles: Sequence[Vector]) -> list[Bound]:
        """Return the limits from bodies at these relative positions [m; world axes]."""
        found = []
        for x, y, z in vehicles:
            r = sqrt(x * x + y * y + z * z)
            if r >= self._ignore_m or r == 0.0:
                continue
            limit = self._rate * max(0.0, r - self._stop_m)
            turning = self._turning_hz * max(0.0, r - self._d_ob)
            aside = max(self._creep, turning) if r < self._stop_m else inf
            found.append(Bound((-x / r, -y / r, -z / r), limit, aside))
        return found

    def from_moving(self, points: Sequence[Vector], coming: Sequence[Vector]) -> list[Bound]:
        """Return the limits from points of which some come nearer by themselves [m/s].

        These do not share the duty, so their speed counts whole: -n.v <= share gap/H - n.coming.
        Where it is negative, nothing holds one from going aside.
        """
        found = []
        for (x, y, z), (u, v, w) in zip(points, coming, strict=True):
            r = max(hypot(x, y, z), 1e-9)
            speed = -(x * u + y * v + z * w) / r
            limit = self._rate * (r - self._stop_m) - speed
            if speed <= 0.0:
                found += self.bounds([(x, y, z)])
            elif limit < self._max_speed:
                found.append(Bound((-x / r, -y / r, -z / r), limit, coming=(u, v, w)))
        return found


class TelemetryRow(NamedTuple):
    """What a neighbour last told: relative position [m], its age [s], the speed it promised."""

    relative: Vector
    age_s: float
    speed_cap: float


class PromiseFilter:
    """Limits approach by what neighbours told, for vehicles without a ranging sensor.

    Each broadcast promises a speed for the next 3 s; the least promise of the last 3 s is kept.
    """

    def __init__(self, d_ob: float, max_speed: float, horizon_s: float) -> None:
        self._d_ob = d_ob
        self._max_speed = max_speed
        self._horizon_s = horizon_s
        self._promises: deque[tuple[float, float]] = deque()

    def promise(self, now_s: float, told: Sequence[TelemetryRow]) -> float:
        """Return the speed to promise now [m/s], and remember it."""
        gap = min(
            (hypot(*each.relative) - self._d_ob - self._max_speed * each.age_s for each in told),
            default=float("inf"),
        )
        cap = min(max(gap / 1.3, LEAST_CAP_MPS), self._max_speed)
        self._promises.append((now_s, cap))
        while self._promises[0][0] < now_s - PROMISE_S:
            self._promises.popleft()
        return cap

    @property
    def speed_cap(self) -> float:
        """The least speed promised in the last 3 s [m/s]."""
        return min((cap for _, cap in self._promises), default=LEAST_CAP_MPS)

    def bounds(self, told: Sequence[TelemetryRow]) -> list[Bound]:
        """Return the limits from what was told; zero where a neighbour may be too near already."""
        found = []
        for relative, age_s, promised in told:
            r = hypot(*relative)
            if r == 0.0:
                continue
            cap = promised if age_s <= PROMISE_S else self._max_speed
            room = r - self._d_ob - cap * (age_s + self._horizon_s)
            away = (-relative[0] / r, -relative[1] / r, -relative[2] / r)
            found.append(Bound(away, max(0.0, room) / self._horizon_s))
        return found


def limited(velocity: Vector, bounds: Sequence[Bound], yaw: float, cone: Cone) -> Vector:
    """Return a velocity that keeps every bound [m/s].

    It first slides along what is in the way, and is shortened where it is still too fast. A slide
    that leaves the cone about ``yaw`` [rad] is not flown: of its climb alone, and of the velocity
    merely shortened, the faster is.
    """
    if all(_keeps(velocity, bound) for bound in bounds):
        return velocity
    sliding = _slid_along(velocity, bounds)
    if _in_cone(sliding, yaw, cone):
        return _kept(sliding, bounds)
    climbing = _kept((0.0, 0.0, sliding[2]), bounds)
    return max(climbing, _kept(velocity, bounds), key=lambda v: hypot(*v))


def slid(velocity: Vector, bounds: Sequence[Bound]) -> Vector:
    """Return a velocity slid along every bound; those that are not negative it keeps [m/s]."""
    return _kept(_slid_along(velocity, bounds), [each for each in bounds if each.limit >= 0.0])


def shortened(velocity: Vector, max_speed: float) -> Vector:
    """Return a velocity no faster than ``max_speed`` [m/s], in the same direction."""
    speed = hypot(*velocity)
    if speed <= max_speed:
        return velocity
    scale = max_speed / speed
    return (velocity[0] * scale, velocity[1] * scale, velocity[2] * scale)


def _slid_along(velocity: Vector, bounds: Sequence[Bound]) -> Vector:
    for _ in range(PASSES):
        for bound in bounds:
            if not _keeps(velocity, bound):
                velocity = _slid(velocity, bound)
    return velocity


def _keeps(velocity: Vector, bound: Bound) -> bool:
    if bound.aside < inf and _across(velocity, bound) > bound.aside + ROUNDING_MPS:
        return False
    return approach_of(velocity, bound) <= bound.limit + ROUNDING_MPS


def _slid(velocity: Vector, bound: Bound) -> Vector:
    """Return a velocity with the parts towards the body and across cut to its limits [m/s]."""
    n, approach = bound.away, approach_of(velocity, bound)
    kept, share = -min(approach, bound.limit), 1.0
    if bound.aside < inf:
        share = min(1.0, bound.aside / max(_across(velocity, bound), 1e-12))
    return (
        share * (velocity[0] + approach * n[0]) + kept * n[0],
        share * (velocity[1] + approach * n[1]) + kept * n[1],
        share * (velocity[2] + approach * n[2]) + kept * n[2],
    )


def _kept(velocity: Vector, bounds: Sequence[Bound]) -> Vector:
    scale = 1.0
    for bound in bounds:
        approach = approach_of(velocity, bound)
        if approach * scale > bound.limit + ROUNDING_MPS:
            scale = bound.limit / approach
        across = _across(velocity, bound) if bound.aside < inf else 0.0
        if across * scale > bound.aside + ROUNDING_MPS:
            scale = bound.aside / across
    return (velocity[0] * scale, velocity[1] * scale, velocity[2] * scale)


def _across(velocity: Vector, bound: Bound) -> float:
    """Return the speed across the line to the body [m/s]."""
    n, approach = bound.away, approach_of(velocity, bound)
    return hypot(
        velocity[0] + approach * n[0], velocity[1] + approach * n[1], velocity[2] + approach * n[2]
    )


def approach_of(velocity: Vector, bound: Bound) -> float:
    """Return the speed towards a body [m/s]."""
    n = bound.away
    return -(velocity[0] * n[0] + velocity[1] * n[1] + velocity[2] * n[2])


def _in_cone(velocity: Vector, yaw: float, cone: Cone) -> bool:
    if hypot(velocity[0], velocity[1]) <= DEAD_BAND_MPS:
        return True
    return cone.holds(azimuth_error(velocity[0], velocity[1], yaw))
