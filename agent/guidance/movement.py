"""Movement: Algorithm 4, lines 5-8. Move if the direction lies in the cone, else turn first."""

from math import atan2, hypot
from typing import Final

from agent.guidance.cone import Cone, azimuth_error
from agent.messages import Vector
from agent.vectors import across

DEAD_BAND_MPS: Final = 0.02
"""Up to this horizontal speed a motion has no azimuth: the vehicle hovers or climbs (E10)."""
SURELY: Final = 1.0 - 1e-9
"""A square that is below its limit by this factor is below it whatever the rounding."""


def steer(wanted: Vector, yaw: float, cone: Cone) -> tuple[Vector, float]:
    """Return the velocity to fly now [m/s] and the heading to turn to [rad].

    wanted: desired velocity [m/s; world frame]; yaw: present heading [rad]. Vehicles hover, climb
    and descend without turning.
    """
    if across(wanted) <= DEAD_BAND_MPS:
        return wanted, yaw
    heading = atan2(wanted[1], wanted[0])
    if cone.holds(azimuth_error(wanted[0], wanted[1], yaw)):
        return wanted, heading
    return (0.0, 0.0, wanted[2]), heading


def saturated(velocity: Vector, max_speed: float, max_climb: float) -> Vector:
    """Return a velocity scaled down, in its direction, to the vehicle's limits [m/s]."""
    x, y, z = velocity
    square = x * x + y * y + z * z
    if square < SURELY * max_speed * max_speed and abs(z) < SURELY * max_climb:
        return velocity
    speed = hypot(x, y, z)
    scale = 1.0
    if speed > max_speed:
        scale = max_speed / speed
    if abs(z) * scale > max_climb:
        scale = max_climb / abs(z)
    return velocity if scale == 1.0 else (x * scale, y * scale, z * scale)
