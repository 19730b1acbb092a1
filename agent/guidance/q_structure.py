"""The adaptive Q-structure as a controller: Algorithm 4, line by line.

Target-on-queue (Algorithm 1, at 5 Hz), bobber (Algorithm 2), potentials (18)-(28), then move or
turn. Plain floats throughout.
"""

from math import dist, pi, radians, sqrt

from agent.controller import Intent, Senses
from agent.guidance.bobber import bobber, cast_zone
from agent.guidance.cone import cone_of
from agent.guidance.movement import saturated, steer
from agent.guidance.potential import Potential
from agent.guidance.target_on_queue import TargetOnQueue
from agent.messages import Place
from agent.qstructure.formation import Formation, Slot
from agent.qstructure.frame import Frame
from agent.qstructure.orientation import FREE
from agent.setup import AgentSetup

GAIN = 2.0
"""c of (28) [1/s]."""
CHOICE_HZ = 5.0
CAST_FAR_M = 0.5
AT_SLOT_M = 0.02
"""So near its slot an agent takes up the queue's orientation."""


class QStructure:
    """Flies one agent into its slot."""

    def __init__(self, setup: AgentSetup) -> None:
        vehicle, control = setup.vehicle, setup.control
        self._max_speed = vehicle.max_speed_mps
        self._max_climb = vehicle.max_climb_mps
        self._cone = cone_of(vehicle)
        self._zone = cast_zone(
            self._cone,
            control.cast_far_m or CAST_FAR_M,
            vehicle.max_speed_mps,
            radians(vehicle.max_yaw_rate_dps),
        )
        self._potential = Potential(control.separation_m)
        formation = Formation(setup.formation, control.spacing_m)
        self._targets = TargetOnQueue(setup.id, formation)
        self._frame = Frame()
        self._mine: tuple[Place, Slot] | None = None
        self._choose_at_s = -1.0

    def decide(self, senses: Senses) -> Intent:
        """Return what to do now; without a place, stay and give way."""
        self._choose(senses)
        q = senses.position
        q_toq, attitude = q, FREE
        if self._mine is not None:
            slot = self._mine[1]
            q_toq, attitude = self._frame.to_world(slot.point), slot.attitude
        q_tg = bobber(q, senses.yaw, q_toq, self._zone)
        x, y, z = self._potential.omega(q, q_tg, senses.neighbours)
        wanted = saturated((-GAIN * x, -GAIN * y, -GAIN * z), self._max_speed, self._max_climb)
        velocity, yaw = steer(wanted, senses.yaw, self._cone)
        tilt = (0.0, 0.0)
        if dist(q, q_toq) < AT_SLOT_M and velocity == wanted:
            yaw = yaw if attitude.yaw is None else attitude.yaw + self._frame.yaw
            tilt = (attitude.pitch or 0.0, attitude.roll or 0.0)
        return Intent(
            wanted,
            velocity,
            yaw % (2.0 * pi),
            GAIN * sqrt(x * x + y * y + z * z),
            q_tg,
            q_toq if self._mine is not None else None,
            self._mine[0] if self._mine is not None else None,
            tilt,
        )

    def _choose(self, senses: Senses) -> None:
        """Choose the own place anew, when it is time to (Algorithm 1 at 5 Hz)."""
        if senses.now_s >= self._choose_at_s:
            self._choose_at_s = senses.now_s + 1.0 / CHOICE_HZ - 1e-9
            self._mine = self._targets.choose(senses.team(), self._frame)
