"""Attitude at the slot: the orientation of the queue, where the vehicle can fly with it.

An agent near a slot at rest turns on the spot. Where its slot moves outside the cone of the queue's
yaw, it keeps the heading of its flight; ``check`` warns of such a queue.
"""

from math import hypot
from typing import Final, final

from agent.config import Vehicle
from agent.guidance.cone import azimuth_error, flight_cone_of
from agent.guidance.movement import DEAD_BAND_MPS
from agent.messages import Vector
from agent.qstructure.formation import Slot
from agent.qstructure.target_frame import Frame
from agent.vectors import across, apart

AT_SLOT_M: Final = 0.05
"""Within this distance of its slot an agent takes up the queue's orientation."""
FORWARD_AT_SLOT_M: Final = 0.02
"""The same for a vehicle that flies only where it points: it must turn to come nearer."""
CREEP_MPS: Final = 0.99 * DEAD_BAND_MPS
"""Horizontal speed at which a vehicle flies in any direction without turning first (E10)."""
MOST_CORRECTION_MPS: Final = 0.1
"""Up to this speed a wanted motion corrects a position; beyond it, it gives way."""


@final
class SlotAttitude:
    """The attitude to take up; an angle that is None is free."""

    def __init__(
        self,
        yaw: float | None = None,  # [rad; world frame]
        tilt: tuple[float, float] = (0.0, 0.0),  # pitch and roll [rad]
        at_rest: bool = False,  # whether the slot rests
    ) -> None:
        self.yaw = yaw
        self.tilt = tilt
        self.at_rest = at_rest


AWAY: Final = SlotAttitude()
"""Of an agent that is not near its slot: every angle is free."""


class AttitudeAtSlot:
    """Takes up the orientation of one agent's queue."""

    def __init__(self, vehicle: Vehicle) -> None:
        self._cone = flight_cone_of(vehicle)
        self._at_slot_m = FORWARD_AT_SLOT_M if vehicle.kind == "forward" else AT_SLOT_M

    def wanted(self, q: Vector, slot: Slot | None, frame: Frame) -> SlotAttitude:
        """Return the attitude to take up at a position q [m; world frame]."""
        if slot is None:
            return AWAY
        q_toq = frame.to_world(slot.point)
        if apart(q, q_toq) >= self._at_slot_m:
            return AWAY
        at_rest = not frame.moves or across(frame.velocity_at(q_toq)) <= DEAD_BAND_MPS
        yaw, pitch, roll = slot.attitude
        in_world = None if yaw is None else yaw + frame.yaw
        return SlotAttitude(in_world, (pitch or 0.0, roll or 0.0), at_rest)

    def approach(self, wanted: Vector, attitude: SlotAttitude) -> Vector:
        """Return the velocity for the last way to a slot [m/s]; wanted: without this rule [m/s].

        The last centimetres may lie in any direction. An agent that turned towards them would turn
        away from the orientation that it holds, so it creeps there without a heading.
        """
        u, v, w = wanted
        speed = hypot(u, v)
        if not attitude.at_rest or attitude.yaw is None or speed > MOST_CORRECTION_MPS:
            return wanted
        if self._flies_with(attitude.yaw, wanted):
            return wanted
        return (CREEP_MPS / speed * u, CREEP_MPS / speed * v, w)

    def heading(self, yaw: float, velocity: Vector, attitude: SlotAttitude) -> float:
        """Return the heading to turn to [rad]: the queue's where the vehicle can fly with it.

        yaw: the heading otherwise [rad]; velocity: to be flown [m/s].
        """
        if attitude.yaw is None or not self._flies_with(attitude.yaw, velocity):
            return yaw
        return attitude.yaw

    def _flies_with(self, yaw: float, velocity: Vector) -> bool:
        """Whether the vehicle can fly a velocity [m/s] while it keeps a heading [rad]."""
        u, v, _ = velocity
        return across(velocity) <= DEAD_BAND_MPS or self._cone.holds(azimuth_error(u, v, yaw))
