"""The cone of directions in which a vehicle may fly without turning first: theta_k of Fig. 5.

It is a cone in azimuth only, for vehicles climb and descend freely (E10).
"""

from math import atan2, radians, remainder, tau
from typing import Final, NamedTuple, assert_never

from agent.config import Vehicle

SLACK_RAD: Final = 1e-9
"""Tolerance for rounding at the cone's edge [rad]."""


class Cone(NamedTuple):
    """Half angles of the cone about the heading."""

    left: float  # theta_1 [rad]
    right: float  # theta_2 [rad]

    def holds(self, error: float) -> bool:
        """Whether a direction with this azimuth error [rad; left positive] lies in the cone."""
        return -self.right - SLACK_RAD <= error <= self.left + SLACK_RAD


def cone_of(vehicle: Vehicle) -> Cone:
    """Return a vehicle's cone: ``max_turn_deg`` on both sides, unless a side has its own angle."""
    left, right = vehicle.max_turn_left_deg, vehicle.max_turn_right_deg
    return Cone(
        radians(vehicle.max_turn_deg if left is None else left),
        radians(vehicle.max_turn_deg if right is None else right),
    )


def flight_cone_of(vehicle: Vehicle) -> Cone:
    """Return the cone of directions in which a vehicle can fly on while it keeps its heading.

    A forward vehicle flies only where it points.
    """
    match vehicle.kind:
        case "kinematic" | "accelerating":
            return cone_of(vehicle)
        case "forward":
            return Cone(0.0, 0.0)
    assert_never(vehicle.kind)


def azimuth_error(x: float, y: float, yaw: float) -> float:
    """Return the angle from the heading yaw to the direction (x, y) [rad], in [-pi, pi]."""
    return remainder(atan2(y, x) - yaw, tau)
