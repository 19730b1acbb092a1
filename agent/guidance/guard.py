"""The last word before the vehicle: which bounds hold for one agent, and how it keeps them.

Bodies are limited by what is sensed where there is a ranging sensor, else by what neighbours told;
obstacles by the points near by, however they are known.
"""

from collections.abc import Callable

from agent.controller import Senses
from agent.guidance.cone import cone_of
from agent.guidance.safety import (
    STATIC,
    Bound,
    PromiseFilter,
    RangingFilter,
    Told,
    limited,
    shortened,
)
from agent.messages import Vector
from agent.sensing.pattern import KINDS
from agent.setup import AgentSetup

SCANNED_M = 0.05
"""So much farther one stays from points that were scanned: noise, and a coarse pattern."""

CREEP = 0.3
"""Such a share of its speed one may go across a point that was scanned, however near it is."""


class Guard:
    """Keeps one agent from all that it knows of."""

    def __init__(self, setup: AgentSetup) -> None:
        limits, control = setup.vehicle, setup.control
        horizon_s = setup.command_ticks / setup.tick_hz
        filtered = (control.separation_m, setup.fleet_max_speed_mps, horizon_s)
        scans = any(kind in limits.sensors for kind in KINDS)
        scanned_m, creep = (SCANNED_M, CREEP * limits.max_speed_mps) if scans else (0.0, 0.0)
        self._cone = cone_of(limits)
        self._ranging = RangingFilter(*filtered) if "proximity" in limits.sensors else None
        self._clearing = RangingFilter(
            control.clearance_m + scanned_m, limits.max_speed_mps, horizon_s, STATIC, creep
        )
        self._promises = PromiseFilter(*filtered)
        self.speed_cap = limits.max_speed_mps

    def safe(self, wanted: Vector, senses: Senses, told: Callable[[], list[Told]]) -> Vector:
        """Return the velocity that is safe to fly [m/s]; told: what neighbours last told."""
        bounds = self._clearing.bounds(senses.obstacles) if senses.obstacles else []
        if self._ranging is not None:
            bounds += self._ranging.bounds(senses.vehicles)
            return self._kept(wanted, bounds, senses.yaw)
        known = told()
        self._promises.promise(senses.now_s, known)
        self.speed_cap = self._promises.speed_cap
        bounds += self._promises.bounds(known)
        return shortened(self._kept(wanted, bounds, senses.yaw), self.speed_cap)

    def _kept(self, wanted: Vector, bounds: list[Bound], yaw: float) -> Vector:
        return limited(wanted, bounds, yaw, self._cone)
