"""The own measured position, which may jump where the vehicle cannot have flown.

What an agent keeps with a position then says nothing: where it found vehicles and surfaces, and
whether its sensors showed others where these reported themselves.
"""

from math import hypot
from typing import Final

from agent.config import Vehicle
from agent.messages import Vector
from agent.vectors import apart

JUMP_M: Final = 0.3
"""Beyond what a vehicle can have flown, its position changes by less without a jump [m]."""


class OwnPose:
    """Watches the positions that one agent measures. slot_s: length of a slot [s]."""

    def __init__(self, vehicle: Vehicle, slot_s: float) -> None:
        self._metres_a_slot = hypot(vehicle.max_speed_mps, vehicle.max_climb_mps) * slot_s
        self._slot, self._position = -1, (0.0, 0.0, 0.0)

    def jumps(self, slot: int, position: Vector) -> bool:
        """Take a measured position [m; world frame]; return whether it has jumped before it."""
        flown_m = (slot - self._slot) * self._metres_a_slot
        first, before = self._slot < 0, self._position
        self._slot, self._position = slot, position
        return not first and apart(before, position) > flown_m + JUMP_M
