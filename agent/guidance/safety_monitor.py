"""The safety monitor: which bounds hold for one agent, and how its kind of vehicle keeps them.

Vehicles set bounds by what is sensed if there is a ranging sensor, else by the neighbours' reports.
Obstacles set bounds by their near points, from whichever sensor. The agent retreats from a surface
that approaches by itself only if it senses nearest points; scanned points count as at rest.
"""

from collections.abc import Callable
from math import hypot, radians
from typing import assert_never

from agent.config import SCANNERS, AgentSetup, VehicleKind
from agent.controller import Senses
from agent.guidance.cone import cone_of
from agent.guidance.evasion import evasive_velocity
from agent.guidance.nonholonomic import forward_evasion, forward_limited
from agent.guidance.safety_filter import (
    ROUNDING_MPS,
    SHARE,
    Bound,
    NeighbourReport,
    PromiseFilter,
    RangingFilter,
    approach_of,
    limited,
    shortened,
)
from agent.messages import ZERO, Vector
from agent.sensing.surface_motion import SurfaceMotion

BRAKING_SHARE = 0.25
"""Share of the gap that one vehicle of bounded acceleration may close until it stands."""
SCAN_MARGIN_M = 0.05
"""Extra distance to scanned points, for noise and a coarse pattern."""
CREEP = 0.3
"""Share of its speed at which a vehicle may always fly across a scanned point."""


class SafetyMonitor:
    """Keeps one agent's velocity within the bounds of all vehicles and obstacles it knows of.

    speed_cap: the speed that the agent promises to its neighbours [m/s].
    """

    def __init__(self, setup: AgentSetup) -> None:
        limits, control = setup.vehicle, setup.control
        self._latency_s = setup.command_ticks / setup.tick_hz
        self._kind = limits.kind
        self._brake_mps2 = limits.max_accel_mps2
        self._turn = radians(limits.max_yaw_rate_dps) * self._latency_s
        horizon_s = self._latency_s + self._stopping_s(setup.fleet_max_speed_mps)
        self._horizon_s = horizon_s
        share = _share_of(limits.kind)
        filtered = (control.separation_m, setup.fleet_max_speed_mps, horizon_s)
        scans = any(kind in limits.sensors for kind in SCANNERS)
        margin_m, creep = (SCAN_MARGIN_M, CREEP * limits.max_speed_mps) if scans else (0.0, 0.0)
        self._cone = cone_of(limits)
        self._speeds = limits.max_speed_mps, limits.max_climb_mps
        self._motion = None if scans else SurfaceMotion(setup.sensor.proximity.noise_m)
        self._ranging = None
        if "proximity" in limits.sensors:
            self._ranging = RangingFilter(*filtered, share, latency_s=self._latency_s)
        self._clearing = RangingFilter(
            control.clearance_m + margin_m,
            limits.max_speed_mps,
            horizon_s,
            2.0 * share,
            creep,
            self._latency_s,
        )
        self._promises = PromiseFilter(*filtered)
        self.speed_cap = limits.max_speed_mps

    def safe_velocity(
        self, wanted: Vector, senses: Senses, reports: Callable[[], list[NeighbourReport]]
    ) -> Vector:
        """Return the velocity that is safe to fly [m/s; world frame].

        reports: returns the neighbours' last reports; called only without a ranging sensor.
        """
        bounds = self._obstacle_bounds(senses) if senses.obstacles else []
        if self._ranging is not None:
            bounds += self._ranging.bounds(senses.vehicles)
            return self._limited(wanted, bounds, senses)
        known = reports()
        self._promises.promise(senses.now_s, known)
        self.speed_cap = self._promises.speed_cap
        bounds += self._promises.bounds(known)
        return shortened(self._limited(wanted, bounds, senses), self.speed_cap)

    def _obstacle_bounds(self, senses: Senses) -> list[Bound]:
        """Return the bounds of obstacles; negative where a surface approaches too fast."""
        points = senses.obstacles
        if self._motion is not None:
            velocities = self._motion.approaching(senses.now_s, senses.position, points)
            if velocities:
                return self._clearing.bounds_of_moving(points, velocities)
        return self._clearing.bounds(points)

    def _limited(self, wanted: Vector, bounds: list[Bound], senses: Senses) -> Vector:
        """Return the velocity that keeps the bounds, as the kind of vehicle can fly it [m/s]."""
        must_retreat = bool(senses.obstacles) and any(bound.limit < 0.0 for bound in bounds)
        match self._kind:
            case "forward":
                if must_retreat:
                    return forward_evasion(bounds, senses.yaw, self._turn, *self._speeds)
                return forward_limited(wanted, bounds, senses.yaw, self._turn)
            case "accelerating":
                if self._must_brake(senses.velocity, bounds):
                    return ZERO
            case "kinematic":
                pass
            case _:
                assert_never(self._kind)
        if must_retreat:
            return evasive_velocity(wanted, bounds, *self._speeds)
        return limited(wanted, bounds, senses.yaw, self._cone)

    def _must_brake(self, velocity: Vector, bounds: list[Bound]) -> bool:
        """Whether a vehicle under way must brake straight: -n.v (H + |v|/2a) > 0.25 gap."""
        needs_s = self._latency_s + self._stopping_s(hypot(*velocity))
        return any(
            approach_of(velocity, bound) * needs_s > bound.limit * self._horizon_s + ROUNDING_MPS
            for bound in bounds
            if bound.limit >= 0.0
        )

    def _stopping_s(self, speed: float) -> float:
        """Return |v|/2a: stopping distance over speed [s]; 0 for a vehicle that stops at once."""
        match self._kind:
            case "accelerating":
                return 0.5 * speed / self._brake_mps2
            case "kinematic" | "forward":
                return 0.0
            case _:
                assert_never(self._kind)


def _share_of(kind: VehicleKind) -> float:
    """Return the share of the gap that one vehicle of a pair may close within H."""
    match kind:
        case "accelerating":
            return BRAKING_SHARE
        case "kinematic" | "forward":
            return SHARE
        case _:
            assert_never(kind)
