"""The last word before the vehicle: which bounds hold for one agent, and how it keeps them.

Bodies are limited by what is sensed where there is a ranging sensor, else by what neighbours told;
obstacles by the points near by, however they are known. To what comes nearer by itself it gives
way, where nearest points are sensed: points that were scanned are taken to stand.
"""

from collections.abc import Callable
from math import hypot, radians

from agent.config import AgentSetup
from agent.controller import Senses
from agent.guidance.cone import cone_of
from agent.guidance.evasion import retreated
from agent.guidance.nonholonomic import forward_kept, forward_retreat
from agent.guidance.safety_filter import (
    ROUNDING_MPS,
    SHARE,
    Bound,
    PromiseFilter,
    RangingFilter,
    TelemetryRow,
    approach_of,
    limited,
    shortened,
)
from agent.messages import ZERO, Vector
from agent.sensing.ray_pattern import KINDS
from agent.sensing.surface_motion import Motion

BRAKING = 0.25
"""Share of the gap that one vehicle of bounded acceleration may close until it stands."""
SCANNED_M = 0.05
"""So much farther one stays from points that were scanned: noise, and a coarse pattern."""
CREEP = 0.3
"""Such a share of its speed one may go across a point that was scanned, however near it is."""


class Guard:
    """Keeps one agent from all that it knows of."""

    def __init__(self, setup: AgentSetup) -> None:
        limits, control = setup.vehicle, setup.control
        self._latency_s = setup.command_ticks / setup.tick_hz
        self._accelerates = limits.kind == "accelerating"
        self._brake_mps2 = limits.max_accel_mps2
        self._sway = radians(limits.max_yaw_rate_dps) * self._latency_s
        self._forward = limits.kind == "forward"
        horizon_s = self._latency_s + self._stopping_s(setup.fleet_max_speed_mps)
        self._horizon_s = horizon_s
        share = BRAKING if self._accelerates else SHARE
        filtered = (control.separation_m, setup.fleet_max_speed_mps, horizon_s)
        scans = any(kind in limits.sensors for kind in KINDS)
        scanned_m, creep = (SCANNED_M, CREEP * limits.max_speed_mps) if scans else (0.0, 0.0)
        self._cone = cone_of(limits)
        self._speeds = limits.max_speed_mps, limits.max_climb_mps
        self._motion = None if scans else Motion(setup.sensor.proximity.noise_m)
        self._ranging = None
        if "proximity" in limits.sensors:
            self._ranging = RangingFilter(*filtered, share, latency_s=self._latency_s)
        self._clearing = RangingFilter(
            control.clearance_m + scanned_m,
            limits.max_speed_mps,
            horizon_s,
            2.0 * share,
            creep,
            self._latency_s,
        )
        self._promises = PromiseFilter(*filtered)
        self.speed_cap = limits.max_speed_mps

    def safe(
        self, wanted: Vector, senses: Senses, told: Callable[[], list[TelemetryRow]]
    ) -> Vector:
        """Return the velocity that is safe to fly [m/s]; told: what neighbours last told."""
        bounds = self._cleared(senses) if senses.obstacles else []
        if self._ranging is not None:
            bounds += self._ranging.bounds(senses.vehicles)
            return self._kept(wanted, bounds, senses)
        known = told()
        self._promises.promise(senses.now_s, known)
        self.speed_cap = self._promises.speed_cap
        bounds += self._promises.bounds(known)
        return shortened(self._kept(wanted, bounds, senses), self.speed_cap)

    def _cleared(self, senses: Senses) -> list[Bound]:
        """Return the limits from obstacles; negative where something comes too fast."""
        points = senses.obstacles
        if self._motion is not None:
            coming = self._motion.coming(senses.now_s, senses.position, points)
            if coming:
                return self._clearing.from_moving(points, coming)
        return self._clearing.bounds(points)

    def _kept(self, wanted: Vector, bounds: list[Bound], senses: Senses) -> Vector:
        comes = bool(senses.obstacles) and any(bound.limit < 0.0 for bound in bounds)
        if self._forward:
            if comes:
                return forward_retreat(bounds, senses.yaw, self._sway, *self._speeds)
            return forward_kept(wanted, bounds, senses.yaw, self._sway)
        if self._accelerates and self._too_fast(senses.velocity, bounds):
            return ZERO
        if comes:
            return retreated(wanted, bounds, *self._speeds)
        return limited(wanted, bounds, senses.yaw, self._cone)

    def _too_fast(self, velocity: Vector, bounds: list[Bound]) -> bool:
        """Whether a vehicle under way must brake straight: -n.v (H + |v|/2a) > 0.25 gap."""
        needs_s = self._latency_s + self._stopping_s(hypot(*velocity))
        return any(
            approach_of(velocity, bound) * needs_s > bound.limit * self._horizon_s + ROUNDING_MPS
            for bound in bounds
            if bound.limit >= 0.0
        )

    def _stopping_s(self, speed: float) -> float:
        """Return |v|/2a: stopping distance over speed [s]; 0 for what stops at once."""
        return 0.5 * speed / self._brake_mps2 if self._accelerates else 0.0
