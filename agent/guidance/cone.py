"""The cone of headings a vehicle may fly without turning first: theta_k of the paper's Fig. 5.

In azimuth only, for vehicles climb and descend freely (E10).
"""

from math import atan2, radians, remainder, tau
from typing import NamedTuple

from agent.config import Vehicle

SLACK = 1e-9


class Cone(NamedTuple):
    """Angles to the left and right of the heading [rad], theta_1 and theta_2."""

    left: float
    right: float

    def holds(self, error: float) -> bool:
        """Whether a direction at this azimuth error [rad], left positive, lies in the cone."""
        return -self.right - SLACK <= error <= self.left + SLACK


def cone_of(vehicle: Vehicle) -> Cone:
    """Return a vehicle's cone: ``max_turn_deg`` to both sides unless a side has its own."""
    left, right = vehicle.max_turn_left_deg, vehicle.max_turn_right_deg
    return Cone(
        radians(vehicle.max_turn_deg if left is None else left),
        radians(vehicle.max_turn_deg if right is None else right),
    )


def azimuth_error(x: float, y: float, yaw: float) -> float:
    """Return the angle from a heading to a horizontal direction [rad], in [-pi, pi]."""
    return remainder(atan2(y, x) - yaw, tau)
