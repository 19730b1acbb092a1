"""Vehicles: every row is one vehicle, in the world frame, in SI units."""

from collections.abc import Sequence
from itertools import chain
from math import cos, inf, isnan, nan, sin, sqrt, tau
from struct import Struct as Layout
from struct import pack
from typing import Final, NamedTuple, assert_never, final

import numpy as np
from numpy.typing import NDArray

from agent.config import Vehicle
from agent.messages import FLIGHT_M, ZERO, Vector

Floats = NDArray[np.float64]
Tilt = tuple[float, float]
"""Pitch and roll [rad]."""
LEVEL: Tilt = (0.0, 0.0)
_TURN: Final = tau


class Poses(NamedTuple):
    """Where N vehicles are and where they point; NaN for a vehicle that is not in the world."""

    position: Floats
    """(N, 3) [m; world frame]"""
    yaw: Floats
    """(N,) [rad; world frame]"""


def wrapped(angle: float) -> float:
    """Return an angle [rad] in [-pi, pi]."""
    turns = angle / _TURN
    if -0.5 <= turns <= 0.5:
        return angle + 0.0  # no negative zero
    if -1.5 < turns < 1.5:  # one turn too much: nearly always, and round() takes long
        return angle - _TURN if turns > 0.0 else angle + _TURN
    return angle - _TURN * round(turns)


@final
class Vehicles:
    """Vehicles of all kinds, which move within their limits; a row of NaN is not in the world.

    Rows of plain numbers; the arrays are copies.
    """

    def __init__(self, position: Floats, yaw: Floats, limits: Sequence[Vehicle]) -> None:
        self.positions: list[Vector] = [(x, y, z) for x, y, z in position.tolist()]
        """[m; world frame]"""
        self.velocities: list[Vector] = [ZERO for _ in limits]
        """[m/s; world frame]"""
        self.yaws: list[float] = yaw.tolist()
        """[rad; world frame]"""
        self.tilts: list[Tilt] = [LEVEL for _ in limits]
        """Pitch and roll [rad]."""
        self._absent = sum([isnan(x) for x, _, _ in self.positions])
        """How many vehicles are not in the world."""
        self._max_tilt: list[float] = np.radians([each.max_tilt_deg for each in limits]).tolist()
        self._tilts = any(self._max_tilt)
        self._level = bytes(16 * len(self.yaws))
        """All tilts where no vehicle can tilt, as doubles."""
        self._pack_row = Layout(f"{(6 if self._tilts else 4) * len(self.yaws)}d").pack
        self._max_accel = [_max_accel_mps2(each) for each in limits]
        self._forward = [_flies_forward(each) for each in limits]
        self._obeys_at_once = not any(self._forward) and min(self._max_accel, default=inf) == inf
        """Whether every vehicle flies whatever velocity it is commanded."""
        self._max_speed = [each.max_speed_mps for each in limits]
        self._max_climb = [each.max_climb_mps for each in limits]
        rates_dps = [each.max_yaw_rate_dps for each in limits]
        self._max_yaw_rate: list[float] = np.radians(rates_dps).tolist()

    def __len__(self) -> int:
        return len(self.yaws)

    def present(self) -> tuple[Vector | None, ...]:
        """Return the positions [m; world frame], None for a vehicle that is not in the world."""
        if self._absent == 0:
            return tuple(self.positions)
        return tuple([None if isnan(each[0]) else each for each in self.positions])

    @property
    def position(self) -> Floats:
        """Return the positions (N, 3) [m; world frame]."""
        return _array(self.positions)

    @property
    def velocity(self) -> Floats:
        """Return the velocities (N, 3) [m/s; world frame]."""
        return _array(self.velocities)

    @property
    def yaw(self) -> Floats:
        """Return the yaws (N,) [rad; world frame]."""
        return np.array(self.yaws)

    @property
    def tilt(self) -> Floats:
        """Return pitch and roll (N, 2) [rad]."""
        return np.array(self.tilts)

    def pose_bytes(self) -> bytes:
        """Return all positions, then all yaws, then all tilts, as doubles."""
        row = _flat(self.positions) + self.yaws
        if not self._tilts:
            return self._pack_row(*row) + self._level
        for pitch, roll in self.tilts:
            row += (pitch, roll)
        return self._pack_row(*row)

    def place(self, row: int, position: Vector, yaw: float) -> None:
        """Put a vehicle into the world [m; world frame, rad], at rest and level."""
        self._absent += isnan(position[0]) - isnan(self.positions[row][0])
        self.positions[row], self.yaws[row] = position, yaw
        self.velocities[row], self.tilts[row] = ZERO, LEVEL

    def remove(self, row: int) -> None:
        """Take a vehicle out of the world."""
        self.place(row, (nan, nan, nan), nan)

    def integrate(
        self, velocity: list[Vector], yaw: list[float], tilt: list[Tilt], dt: float
    ) -> None:
        """Fly for ``dt`` [s] at velocities [m/s], towards yaws and tilts [rad], one for each.

        The velocities must be within the vehicles' limits of speed and climb.
        """
        if self._obeys_at_once:
            self.velocities = velocity.copy()
        for row, (x, y, z) in enumerate(self.positions):
            if not self._obeys_at_once:
                self.velocities[row] = self._flown(row, velocity[row], dt)
            if isnan(x):
                continue
            u, v, w = self.velocities[row]
            self.positions[row] = (
                _within(x + u * dt, FLIGHT_M),
                _within(y + v * dt, FLIGHT_M),
                _within(z + w * dt, FLIGHT_M),
            )
            reach, now = self._max_yaw_rate[row] * dt, self.yaws[row]
            self.yaws[row] = wrapped(now + _within(wrapped(yaw[row] - now), reach))
            if self._tilts:
                self._tilt_towards(row, tilt[row], reach)

    def within_limits(self, row: int, velocity: Vector) -> Vector:
        """Return a velocity [m/s] scaled down to a vehicle's limits of speed and climb."""
        x, y, z = velocity
        max_speed, max_climb = self._max_speed[row], self._max_climb[row]
        square = x * x + y * y + z * z
        if square <= max_speed * max_speed and abs(z) <= max_climb:
            return velocity
        scale = min(1.0, max_speed / sqrt(square), max_climb / max(abs(z), 1e-12))
        return x * scale, y * scale, z * scale

    def _flown(self, row: int, velocity: Vector, dt: float) -> Vector:
        """Return the velocity [m/s] flown for ``dt`` [s] where another one is commanded."""
        if self._forward[row]:
            velocity = self._along_heading(row, velocity)
        if self._max_accel[row] < inf:
            velocity = self._accelerated(row, velocity, dt)
        return velocity

    def _along_heading(self, row: int, velocity: Vector) -> Vector:
        """Return the part of a velocity [m/s] that a vehicle flies which only moves forward."""
        x, y, z = velocity
        yaw = self.yaws[row]
        c, s = (0.0, 0.0) if isnan(yaw) else (cos(yaw), sin(yaw))
        forward = max(0.0, c * x + s * y)
        return c * forward, s * forward, z

    def _accelerated(self, row: int, velocity: Vector, dt: float) -> Vector:
        """Return the velocity [m/s] reached after ``dt`` [s] towards one that is commanded."""
        x, y, z = self.velocities[row]
        u, v, w = velocity
        du, dv, dw = u - x, v - y, w - z
        size = sqrt(du * du + dv * dv + dw * dw)
        share = self._max_accel[row] * dt / max(size, 1e-12)
        # A share of 1 would add rounding errors to vehicles that reach any velocity at once.
        return (x + share * du, y + share * dv, z + share * dw) if share < 1.0 else velocity

    def _tilt_towards(self, row: int, tilt: Tilt, reach: float) -> None:
        (pitch, roll), most = self.tilts[row], self._max_tilt[row]
        self.tilts[row] = (
            pitch + _within(_within(tilt[0], most) - pitch, reach),
            roll + _within(_within(tilt[1], most) - roll, reach),
        )


def _array(rows: list[Vector]) -> Floats:
    return array_of(_flat(rows)).reshape(-1, 3)


def array_of(numbers: list[float]) -> Floats:
    """Return numbers as an array that nobody may change; numpy itself is slow to read a list."""
    return np.frombuffer(pack(f"{len(numbers)}d", *numbers))


def _flat(rows: list[Vector]) -> list[float]:
    return list(chain.from_iterable(rows))


def _within(value: float, most: float) -> float:
    """Return a value limited to [-most, most]."""
    return -most if value < -most else most if value > most else value


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
