"""The adaptive Q-structure as a controller: Algorithm 4, line by line.

Target-on-queue (Algorithm 1, at 5 Hz), bobber (Algorithm 2), potentials (18)-(28), then move or
turn. Plain floats throughout.
"""

from math import pi, radians, sqrt

from agent.controller import Intent, Senses
from agent.guidance.bobber import bobber, cast_zone
from agent.guidance.movement import saturated, steer
from agent.guidance.potential import Potential
from agent.guidance.target_on_queue import TargetOnQueue
from agent.messages import Place
from agent.qstructure.formation import Formation
from agent.qstructure.frame import Frame
from agent.setup import AgentSetup

GAIN = 2.0
"""c of (28) [1/s]."""
CHOICE_HZ = 5.0
CAST_FAR_M = 0.5


class QStructure:
    """Flies one agent into its slot."""

    def __init__(self, setup: AgentSetup) -> None:
        vehicle, control = setup.vehicle, setup.control
        self._max_speed = vehicle.max_speed_mps
        self._max_climb = vehicle.max_climb_mps
        self._theta = radians(vehicle.max_turn_deg)
        self._zone = cast_zone(
            self._theta,
            control.cast_far_m or CAST_FAR_M,
            vehicle.max_speed_mps,
            radians(vehicle.max_yaw_rate_dps),
        )
        self._potential = Potential(control.separation_m)
        self._targets = TargetOnQueue(setup.id, Formation(setup.formation), control.spacing_m)
        self._frame = Frame()
        self._place: Place | None = None
        self._choice_period_s = 1.0 / CHOICE_HZ
        self._choose_at_s = -1.0

    def decide(self, senses: Senses) -> Intent:
        """Return what to do now."""
        place = self._own_place(senses)
        q = senses.position
        q_toq = self._targets.slot(place, self._frame)
        q_tg = bobber(q, senses.yaw, q_toq, self._zone)
        x, y, z = self._potential.omega(q, q_tg, senses.neighbours)
        force = GAIN * sqrt(x * x + y * y + z * z)
        wanted = saturated((-GAIN * x, -GAIN * y, -GAIN * z), self._max_speed, self._max_climb)
        velocity, yaw = steer(wanted, senses.yaw, self._theta)
        return Intent(wanted, velocity, yaw % (2.0 * pi), force, q_tg, q_toq, place)

    def _own_place(self, senses: Senses) -> Place:
        if self._place is None or senses.now_s >= self._choose_at_s:
            self._choose_at_s = senses.now_s + self._choice_period_s - 1e-9
            self._place = self._targets.choose(senses.team(), self._frame)
        return self._place
