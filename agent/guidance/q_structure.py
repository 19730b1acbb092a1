"""The adaptive Q-structure as a controller: Algorithm 4, line by line.

Target-on-queue (Algorithm 1, at 5 Hz), bobber (Algorithm 2), constellation-agents (Algorithm 3),
potentials (18)-(28), then move or turn. All numbers are plain floats.
"""

from math import dist, pi, radians, sqrt
from typing import Final

from agent.config import AgentSetup
from agent.controller import Intent, Senses
from agent.guidance.bobber import CastZone, bobber, cast_reach, cast_zone
from agent.guidance.cone import cone_of
from agent.guidance.constellation import avoidance_of
from agent.guidance.deadlock_escape import DeadlockEscape
from agent.guidance.held_point import HeldPoint
from agent.guidance.movement import saturated, steer
from agent.guidance.place_selection import place_selection
from agent.guidance.potential import Potential
from agent.guidance.slot_attitude import AttitudeAtSlot
from agent.messages import ZERO, Vector
from agent.places.place_points import OwnTarget
from agent.qstructure.target_frame import Frame

GAIN: Final = 2.0
"""c of (28) [1/s]."""
GIVES_WAY_M: Final = 0.01
"""An agent without a mission holds no point from which others push it by more than this."""


class QStructure:
    """Flies one agent to its slot in the formation."""

    def __init__(self, setup: AgentSetup) -> None:
        vehicle, control = setup.vehicle, setup.control
        self._control = control
        self._max_speed = vehicle.max_speed_mps
        self._max_climb = vehicle.max_climb_mps
        self._cone = cone_of(vehicle)
        self._max_yaw_rate = radians(vehicle.max_yaw_rate_dps)
        self._attitude = AttitudeAtSlot(vehicle)
        self._potential = Potential(control.separation_m)
        self._places = place_selection(setup)
        self._held = HeldPoint()
        self._avoidance = avoidance_of(control.avoidance, control.safety_m)
        self._escape = DeadlockEscape(setup.id)
        self._heard_m = -1.0
        self._zone: CastZone | None = None
        """The cast-zone where others were heard from as far as ``_heard_m``."""

    def decide(self, senses: Senses) -> Intent:
        """Return the intent; an agent without a place stays where it is and gives way."""
        q, own = senses.position, self._places.select(senses)
        q_toq, frame = self._destination(senses, own)
        zone = self._zone_within(senses.link.reach_m)
        q_tg = bobber(q, senses.yaw, _aim_point(q_toq, frame), zone)
        x, y, z = self._potential.omega(q, q_tg, senses.neighbours)
        if senses.mission is None and _pushed_m(q, q_tg, (x, y, z)) > GIVES_WAY_M:
            self._held.give_way()
        escape = self._escape.direction(senses, q_toq)
        if senses.obstacles and not self._escape.rounds_obstacle:
            a, b, c = self._obstacle_term(senses)
            x, y, z = x + a, y + b, z + c
        attitude = self._attitude.wanted(q, own.slot if own is not None else None, frame)
        wanted = self._wanted((-GAIN * x, -GAIN * y, -GAIN * z), escape)
        wanted = self._attitude.approach(wanted, attitude)
        velocity, yaw = steer(wanted, senses.yaw, self._cone)
        tilt = (0.0, 0.0)
        if velocity == wanted:
            yaw, tilt = self._attitude.heading(yaw, velocity, attitude), attitude.tilt
        return Intent(
            wanted=wanted,
            velocity=velocity,
            yaw=yaw % (2.0 * pi),
            force=GAIN * sqrt(x * x + y * y + z * z),
            heading_for=q_tg,
            target=q_toq if own is not None else None,
            place=own.place if own is not None else None,
            tilt=tilt,
            cost_m=self._places.cost_m,
            vertex=own is not None and own.vertex,
            blocked=self._places.blocked,
            words=self._places.words(senses.now_s),
        )

    def _destination(self, senses: Senses, own: OwnTarget | None) -> tuple[Vector, Frame]:
        """Return where to fly in the end [m; world frame], and the frame in which that rests."""
        if senses.mission is None:
            return self._held.target(senses)
        frame = senses.mission.frame
        return frame.to_world(own.slot.point) if own is not None else senses.position, frame

    def _zone_within(self, heard_m: float) -> CastZone:
        """Return the cast-zone where others were heard from so far at most [m] (E20)."""
        if self._zone is None or heard_m != self._heard_m:
            reach = cast_reach(self._control, heard_m, self._max_speed / GAIN)
            self._heard_m = heard_m
            self._zone = cast_zone(self._cone, reach, self._max_speed, self._max_yaw_rate)
        return self._zone

    def _obstacle_term(self, senses: Senses) -> Vector:
        """Return the term that near surfaces add to Omega [m; world axes]."""
        if self._avoidance is None:
            return ZERO
        return self._avoidance.omega(senses.yaw, senses.obstacles)

    def _wanted(self, u: Vector, escape: Vector | None) -> Vector:
        """Return u of (28) within the vehicle's limits, plus the escape manoeuvre (E23) [m/s]."""
        wanted = saturated(u, self._max_speed, self._max_climb)
        if escape is None:
            return wanted
        v = self._max_speed
        escaping = (wanted[0] + v * escape[0], wanted[1] + v * escape[1], wanted[2] + v * escape[2])
        return saturated(escaping, self._max_speed, self._max_climb)


def _pushed_m(q: Vector, q_tg: Vector, omega: Vector) -> float:
    """Return the neighbours' share of Omega [m]."""
    return dist((q[0] - q_tg[0], q[1] - q_tg[1], q[2] - q_tg[2]), omega)


def _aim_point(q_toq: Vector, frame: Frame) -> Vector:
    """Return the point to aim for so that a moving slot is held [m; world frame].

    It lies 1 / c ahead of the slot: once the agent is at the slot, c (q_tg - q) is the slot's own
    velocity.
    """
    if not frame.moves:
        return q_toq
    (x, y, z), (u, v, w) = q_toq, frame.velocity_at(q_toq)
    return (x + u / GAIN, y + v / GAIN, z + w / GAIN)
