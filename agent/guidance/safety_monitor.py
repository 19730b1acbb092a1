"""The safety monitor: which bounds hold for one agent, and how its kind of vehicle keeps them.

Vehicles set bounds by what is sensed if there is a ranging sensor, else by the neighbours' reports.
Obstacles set bounds by their near points, from whichever sensor. The agent retreats from a surface
that approaches by itself only if it senses nearest points; scanned points count as at rest.
"""

from collections.abc import Iterable
from math import hypot, radians
from typing import Final, assert_never

from agent.comms.whereabouts import Whereabouts
from agent.config import AgentSetup, Vehicle, VehicleKind
from agent.controller import Senses
from agent.guidance.cone import cone_of
from agent.guidance.evasion import evasive_velocity
from agent.guidance.nonholonomic import forward_evasion, forward_limited
from agent.guidance.promise_filter import PromiseFilter
from agent.guidance.safety_filter import (
    ROUNDING_MPS,
    SHARE,
    Bound,
    Margins,
    RangingFilter,
    approach_of,
    limited,
    shortened,
)
from agent.guidance.sight import (
    BRAKING_SHARE,
    braking_of,
    scanners_of,
    speed_cap_mps,
    surface_margin_m,
    vehicle_margin_m,
)
from agent.heard_beacon import HeardBeacon
from agent.messages import ZERO, Record, Vector
from agent.sensing.surface_motion import LEAST_MPS, SurfaceMotion

CLIMBS: Final = 1.5
"""How far a vehicle climbs out of the way of a surface, in clearances."""
CREEP: Final = 0.3
"""Share of its speed at which a vehicle may always fly along a surface that noise may displace."""


class SafetyMonitor:
    """Keeps one agent's velocity within the bounds of all vehicles and obstacles it knows of.

    speed_cap: the speed that the agent promises to its neighbours [m/s]. restarted: whether it may
    have made promises before.
    """

    def __init__(self, setup: AgentSetup, restarted: bool = False) -> None:
        limits, control, sensor = setup.vehicle, setup.control, setup.sensor
        self._latency_s = setup.command_ticks / setup.tick_hz
        self._braking = braking_of(limits, self._latency_s)
        self._kind = limits.kind
        self._turn = radians(limits.max_yaw_rate_dps) * self._latency_s
        self._speed_limit = speed_cap_mps(limits, control, sensor, self._braking)
        fastest = min(setup.fleet_max_speed_mps, self._speed_limit)
        horizon_s = self._horizon_s = self._braking.horizon_s(fastest)
        share = _share_of(limits.kind)
        self._cone = cone_of(limits)
        self._speeds = limits.max_speed_mps, limits.max_climb_mps
        self._motion = None if scanners_of(limits) else SurfaceMotion(sensor.proximity.noise_m)
        self._clearing = RangingFilter(
            control.clearance_m,
            limits.max_speed_mps,
            horizon_s,
            Margins(
                share=2.0 * share,
                noise_m=surface_margin_m(limits, sensor),
                retreats=self._kind != "forward",
                unnoticed_mps=LEAST_MPS,
                evading_s=_evading_s(limits, control.clearance_m),
                creep=CREEP * limits.max_speed_mps if surface_margin_m(limits, sensor) else 0.0,
                latency_s=self._latency_s,
            ),
        )
        self._ranging = RangingFilter(
            control.separation_m,
            setup.fleet_max_speed_mps,
            horizon_s,
            Margins(share=share, noise_m=vehicle_margin_m(sensor), latency_s=self._latency_s),
        )
        self._promises, self._whereabouts = None, Whereabouts(setup.id, setup.team)
        if "proximity" not in limits.sensors:
            self._promises = PromiseFilter(
                control.separation_m,
                setup.fleet_max_speed_mps,
                self._braking,
                restarted=restarted,
            )
        self.speed_cap = limits.max_speed_mps

    def hear(self, beacon: HeardBeacon) -> None:
        """Take a neighbour's newest beacon."""
        if self._promises is not None:
            self._whereabouts.hear(beacon)

    def relay(self, newest: Iterable[HeardBeacon | Record]) -> None:
        """Take the newest statements of all members."""
        if self._promises is not None:
            self._whereabouts.relay(newest)

    def safe_velocity(self, wanted: Vector, senses: Senses) -> Vector:
        """Return the velocity that is safe to fly [m/s; world frame]."""
        bounds = self._obstacle_bounds(senses) if senses.obstacles else []
        if self._promises is not None:
            return self._promised(self._promises, wanted, bounds, senses)
        bounds += self._ranging.bounds(senses.vehicles)
        return shortened(self._limited(wanted, bounds, senses), self._speed_limit)

    def _promised(
        self, promises: PromiseFilter, wanted: Vector, bounds: list[Bound], senses: Senses
    ) -> Vector:
        """Return the velocity that is safe by what other vehicles reported [m/s; world frame]."""
        now_s, velocity = senses.now_s, senses.velocity
        reports = self._whereabouts.reports(senses.position, now_s)
        self.speed_cap = promises.promise(now_s, hypot(*velocity), reports)
        safe = ZERO
        if self._whereabouts.complete and not promises.must_stand(velocity, reports):
            bounds += promises.bounds(velocity, reports)
            safe = self._limited(wanted, bounds, senses)
            safe = shortened(safe, min(promises.speed_limit, self._speed_limit))
        promises.command(now_s, hypot(*safe))
        return safe

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
        needs_s = self._braking.horizon_s(hypot(*velocity))
        return any(
            approach_of(velocity, bound) * needs_s
            > max(0.0, bound.limit) * self._horizon_s + ROUNDING_MPS
            for bound in bounds
            if bound.limit >= 0.0 or bound.surface_velocity == ZERO
        )


def _evading_s(vehicle: Vehicle, clearance_m: float) -> float:
    """Return the time that a vehicle needs to leave the way of a surface [s]; 0 for at once.

    A vehicle that only flies forward climbs or sinks, over a distance of about the clearance.
    """
    match vehicle.kind:
        case "forward":
            return CLIMBS * clearance_m / min(vehicle.max_climb_mps, vehicle.max_speed_mps)
        case "kinematic" | "accelerating":
            return 0.0
        case _:
            assert_never(vehicle.kind)


def _share_of(kind: VehicleKind) -> float:
    """Return the share of the gap that one vehicle of a pair may close within H."""
    match kind:
        case "accelerating":
            return BRAKING_SHARE
        case "kinematic" | "forward":
            return SHARE
        case _:
            assert_never(kind)
