"""Vehicles as arrays: every row is one vehicle, in the world frame, in SI units.

Only + - * / sqrt and rounding act across rows here, so that a trace is the same in every clock.
"""

from collections.abc import Sequence
from math import cos, isnan, sin, sqrt
from typing import NamedTuple, assert_never

import numpy as np
from numpy.typing import NDArray

from agent.config import Vehicle
from agent.messages import FLIGHT_M, Vector

Floats = NDArray[np.float64]
_TURN = 2.0 * np.pi


class Poses(NamedTuple):
    """Where N vehicles are and where they point; NaN for a vehicle that is not in the world."""

    position: Floats
    """(N, 3) [m; world frame]"""
    yaw: Floats
    """(N,) [rad; world frame]"""


def wrapped(angle: Floats) -> Floats:
    """Return angles [rad] in [-pi, pi]."""
    return angle - _TURN * np.rint(angle / _TURN)


class Vehicles:
    """Vehicles of all kinds, which move within their limits; a row of NaN is not in the world."""

    def __init__(self, position: Floats, yaw: Floats, limits: Sequence[Vehicle]) -> None:
        self.position = position.astype(np.float64)
        """(N, 3) [m; world frame]"""
        self.velocity = np.zeros_like(self.position)
        """(N, 3) [m/s; world frame]"""
        self.yaw = yaw.astype(np.float64)
        """(N,) [rad; world frame]"""
        self.tilt = np.zeros((len(self.yaw), 2))
        """(N, 2): pitch and roll [rad]."""
        self._max_tilt = np.radians([[each.max_tilt_deg] for each in limits])
        self._tilts = bool(self._max_tilt.any())
        self._max_accel = np.array([[_max_accel_mps2(each)] for each in limits])
        self._accelerates = bool(np.isfinite(self._max_accel).any())
        self._forward = [row for row, each in enumerate(limits) if _flies_forward(each)]
        self._max_speed = [each.max_speed_mps for each in limits]
        self._max_climb = [each.max_climb_mps for each in limits]
        self._max_yaw_rate = np.radians([each.max_yaw_rate_dps for each in limits])

    def __len__(self) -> int:
        return len(self.yaw)

    def place(self, row: int, position: Vector, yaw: float) -> None:
        """Put a vehicle into the world [m; world frame, rad], at rest and level."""
        self.position[row], self.velocity[row], self.tilt[row] = position, 0.0, 0.0
        self.yaw[row] = yaw

    def remove(self, row: int) -> None:
        """Take a vehicle out of the world."""
        self.position[row] = self.yaw[row] = np.nan
        self.velocity[row] = self.tilt[row] = 0.0

    def integrate(self, velocity: Floats, yaw: Floats, tilt: Floats, dt: float) -> None:
        """Fly for ``dt`` [s] at velocities (N, 3) [m/s], towards yaws (N,) and tilts (N, 2) [rad].

        The velocities must be within the vehicles' limits of speed and climb.
        """
        velocity = velocity.copy()
        for row in self._forward:
            velocity[row] = self._along_heading(row, velocity[row])
        if self._accelerates:
            velocity = self._accelerated(velocity, dt)
        self.velocity = velocity
        moved = self.position + velocity * dt
        self.position = np.minimum(np.maximum(moved, -FLIGHT_M), FLIGHT_M)
        reach = self._max_yaw_rate * dt
        turn = np.minimum(np.maximum(wrapped(yaw - self.yaw), -reach), reach)
        self.yaw = wrapped(self.yaw + turn)
        if self._tilts:
            self._tilt_towards(tilt, reach[:, None])

    def within_limits(self, row: int, velocity: Vector) -> Vector:
        """Return a velocity [m/s] scaled down to a vehicle's limits of speed and climb."""
        x, y, z = velocity
        max_speed, max_climb = self._max_speed[row], self._max_climb[row]
        square = x * x + y * y + z * z
        if square <= max_speed * max_speed and abs(z) <= max_climb:
            return velocity
        scale = min(1.0, max_speed / sqrt(square), max_climb / max(abs(z), 1e-12))
        return x * scale, y * scale, z * scale

    def _along_heading(self, row: int, velocity: Floats) -> Vector:
        """Return the part of a velocity [m/s] that a vehicle flies which only moves forward."""
        x, y, z = velocity.tolist()
        yaw = float(self.yaw[row])
        c, s = (0.0, 0.0) if isnan(yaw) else (cos(yaw), sin(yaw))
        forward = max(0.0, c * x + s * y)
        return c * forward, s * forward, z

    def _accelerated(self, velocity: Floats, dt: float) -> Floats:
        """Return the velocities [m/s] reached after ``dt`` [s] towards those commanded."""
        change = velocity - self.velocity
        size = np.sqrt(
            change[:, :1] * change[:, :1]
            + change[:, 1:2] * change[:, 1:2]
            + change[:, 2:] * change[:, 2:]
        )
        share = np.minimum(1.0, self._max_accel * dt / np.maximum(size, 1e-12))
        # A share of 1 would add rounding errors to vehicles that reach any velocity at once.
        return np.where(share < 1.0, self.velocity + share * change, velocity)

    def _tilt_towards(self, tilt: Floats, reach: Floats) -> None:
        tilt = np.minimum(np.maximum(tilt, -self._max_tilt), self._max_tilt)
        self.tilt = self.tilt + np.minimum(np.maximum(tilt - self.tilt, -reach), reach)


def _max_accel_mps2(vehicle: Vehicle) -> float:
    match vehicle.kind:
        case "accelerating":
            return vehicle.max_accel_mps2
        case "kinematic" | "forward":
            return np.inf
    assert_never(vehicle.kind)


def _flies_forward(vehicle: Vehicle) -> bool:
    """Return whether a vehicle moves only where it points."""
    match vehicle.kind:
        case "forward":
            return True
        case "kinematic" | "accelerating":
            return False
    assert_never(vehicle.kind)
