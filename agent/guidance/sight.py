"""Sight: what a vehicle's sensors leave unknown, and how fast it may fly because of it.

A sensor's noise becomes a margin of distance. A sensor's reach becomes a speed from which the
vehicle still comes to rest before what it sees at the edge of that reach.
"""

from math import inf, sqrt
from typing import Final, NamedTuple, assert_never

from agent.config import SCANNERS, Control, ScannerKind, Sensors, Vehicle
from agent.messages import PROXIMITY_RANGE_M

NOISE_SIGMAS: Final = 5.0
"""Standard deviations of a sensor's noise that its margin covers."""
SCAN_MARGIN_M: Final = 0.05
"""Least margin of scanned points, for a coarse pattern [m]."""
SCANS_MISSED: Final = 3
"""Scans that may show a surface too late: it falls between rays, or an echo drops out."""
BRAKING_SHARE: Final = 0.25
"""Share of the gap that one vehicle of bounded acceleration may close until it stands."""


def vehicle_margin_m(sensors: Sensors) -> float:
    """Return the margin for the proximity sensor's noise, to sensed vehicles [m]."""
    return NOISE_SIGMAS * sensors.proximity.noise_m


def surface_margin_m(vehicle: Vehicle, sensors: Sensors) -> float:
    """Return the margin for noise and coarse patterns, to surfaces of obstacles [m]."""
    margins = [SCAN_MARGIN_M, *(NOISE_SIGMAS * sensors.scanner(k).noise_m for k in SCANNERS)]
    found = max(margins) if scanners_of(vehicle) else 0.0
    return max(found, vehicle_margin_m(sensors)) if "proximity" in vehicle.sensors else found


def scanners_of(vehicle: Vehicle) -> list[ScannerKind]:
    """Return the scanning sensors that a vehicle carries."""
    return [kind for kind in SCANNERS if kind in vehicle.sensors]


class Braking(NamedTuple):
    """How a vehicle comes to rest."""

    latency_s: float  # from a measurement to the expiry of the command made from it [s]
    decel_mps2: float = inf  # infinite for a vehicle that stops at once [m/s2]

    def stopping_s(self, speed: float) -> float:
        """Return the time in which a vehicle of this speed [m/s] has come to rest [s]."""
        return self.latency_s + speed / self.decel_mps2

    def stopping_m(self, speed: float) -> float:
        """Return the distance that a vehicle of this speed [m/s] flies until it rests [m]."""
        return speed * self.horizon_s(speed)

    def horizon_s(self, speed: float) -> float:
        """Return the stopping distance over the speed [s]: H of a vehicle of this speed [m/s]."""
        return self.latency_s + 0.5 * speed / self.decel_mps2

    def speed_mps(self, room_m: float) -> float:
        """Return the speed from which a vehicle comes to rest within a distance [m/s]."""
        if self.decel_mps2 == inf:
            return room_m / self.latency_s
        return self.decel_mps2 * (
            sqrt(self.latency_s**2 + 2.0 * room_m / self.decel_mps2) - self.latency_s
        )


def braking_of(vehicle: Vehicle, latency_s: float) -> Braking:
    """Return how a kind of vehicle comes to rest."""
    match vehicle.kind:
        case "accelerating":
            return Braking(latency_s, vehicle.max_accel_mps2)
        case "kinematic" | "forward":
            return Braking(latency_s)
        case _:
            assert_never(vehicle.kind)


def speed_cap_mps(vehicle: Vehicle, control: Control, sensors: Sensors, braking: Braking) -> float:
    """Return the speed from which a vehicle comes to rest before what it first sees [m/s].

    A vehicle that stops at once may use up the whole way to it, one that brakes only its share. A
    distance to keep that is larger than the sensor's reach sets no cap: no speed is safe then.
    """
    if "proximity" in vehicle.sensors:
        to_vehicles = PROXIMITY_RANGE_M - control.separation_m - vehicle_margin_m(sensors)
        to_surfaces = PROXIMITY_RANGE_M - control.clearance_m - surface_margin_m(vehicle, sensors)
        rooms = [(to_vehicles, BRAKING_SHARE, 0.0), (to_surfaces, 2.0 * BRAKING_SHARE, 0.0)]
    else:
        margin_m = control.clearance_m + surface_margin_m(vehicle, sensors)
        rooms = [
            (
                min(PROXIMITY_RANGE_M, sensors.scanner(kind).range_m) - margin_m,
                2.0 * BRAKING_SHARE,
                SCANS_MISSED / sensors.scanner(kind).rate_hz,
            )
            for kind in scanners_of(vehicle)
        ]
    stops_at_once = braking.decel_mps2 == inf
    return min(
        (
            braking._replace(latency_s=braking.latency_s + late_s).speed_mps(
                room_m if stops_at_once else share * room_m
            )
            for room_m, share, late_s in rooms
            if room_m > 0.0
        ),
        default=inf,
    )
