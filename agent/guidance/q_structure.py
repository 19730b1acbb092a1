"""The adaptive Q-structure as a controller: Algorithm 4, line by line.

Target-on-queue (Algorithm 1, at 5 Hz), bobber (Algorithm 2), constellation-agents (Algorithm 3),
potentials (18)-(28), then move or turn. Plain floats throughout.
"""

from math import dist, hypot, pi, radians, sqrt

from agent.config import DEFAULT_CAST_FAR_M, AgentSetup
from agent.controller import Intent, Senses
from agent.guidance.bobber import bobber, cast_zone
from agent.guidance.cone import azimuth_error, cone_of
from agent.guidance.constellation import avoidance
from agent.guidance.deadlock_escape import Dodge
from agent.guidance.movement import DEAD_BAND_MPS, saturated, steer
from agent.guidance.potential import Potential
from agent.guidance.slot_selection import Choice
from agent.messages import ZERO, Vector
from agent.qstructure.target_frame import Frame

GAIN = 2.0
"""c of (28) [1/s]."""
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
            control.cast_far_m or DEFAULT_CAST_FAR_M,
            vehicle.max_speed_mps,
            radians(vehicle.max_yaw_rate_dps),
        )
        self._potential = Potential(control.separation_m)
        self._choice = Choice(setup)
        self._avoidance = avoidance(control.avoidance, control.safety_m)
        self._dodge = Dodge(setup.id)

    def decide(self, senses: Senses) -> Intent:
        """Return what to do now; without a place, stay and give way."""
        q, mine, frame = senses.position, self._choice.made(senses), senses.mission.frame
        q_toq = frame.to_world(mine.slot.point) if mine is not None else q
        q_tg = bobber(q, senses.yaw, _led(q_toq, frame), self._zone)
        x, y, z = self._potential.omega(q, q_tg, senses.neighbours)
        aside = self._dodge.direction(senses, q_toq)
        if senses.obstacles and not self._dodge.rounds:
            a, b, c = self._cleared(senses)
            x, y, z = x + a, y + b, z + c
        wanted = self._wanted((-GAIN * x, -GAIN * y, -GAIN * z), aside)
        velocity, yaw = steer(wanted, senses.yaw, self._cone)
        tilt = (0.0, 0.0)
        if mine is not None and dist(q, q_toq) < AT_SLOT_M and velocity == wanted:
            attitude = mine.slot.attitude
            yaw = self._heading(yaw, attitude.yaw, velocity, frame)
            tilt = (attitude.pitch or 0.0, attitude.roll or 0.0)
        return Intent(
            wanted=wanted,
            velocity=velocity,
            yaw=yaw % (2.0 * pi),
            force=GAIN * sqrt(x * x + y * y + z * z),
            heading_for=q_tg,
            target=q_toq if mine is not None else None,
            place=mine.place if mine is not None else None,
            tilt=tilt,
            cost_m=self._choice.cost_m,
            vertex=mine is not None and mine.vertex,
            blocked=self._choice.blocked,
        )

    def _cleared(self, senses: Senses) -> Vector:
        """Return what surfaces near by add to Omega [m]; silent while one goes round them."""
        if self._avoidance is None:
            return ZERO
        return self._avoidance.omega(senses.yaw, senses.obstacles)

    def _heading(self, yaw: float, asked: float | None, velocity: Vector, frame: Frame) -> float:
        """Return the heading at the slot [rad]: the queue's, if one can fly on with it."""
        if asked is None:
            return yaw
        u, v, _ = velocity
        error = azimuth_error(u, v, asked + frame.yaw)
        flies_on = hypot(u, v) <= DEAD_BAND_MPS or self._cone.holds(error)
        return asked + frame.yaw if flies_on else yaw

    def _wanted(self, u: Vector, aside: Vector | None) -> Vector:
        """Return u of (28) [m/s] within the vehicle's limits, and past what holds it (E23)."""
        wanted = saturated(u, self._max_speed, self._max_climb)
        if aside is None:
            return wanted
        v = self._max_speed
        past = (wanted[0] + v * aside[0], wanted[1] + v * aside[1], wanted[2] + v * aside[2])
        return saturated(past, self._max_speed, self._max_climb)


def _led(q_toq: Vector, frame: Frame) -> Vector:
    """Return where to aim for so that a slot that moves is held [m; world frame].

    1 / c ahead of it: there c (q_tg - q) is the slot's own velocity, once one is at the slot.
    """
    if not frame.moves:
        return q_toq
    (x, y, z), (u, v, w) = q_toq, frame.velocity_at(q_toq)
    return (x + u / GAIN, y + v / GAIN, z + w / GAIN)
