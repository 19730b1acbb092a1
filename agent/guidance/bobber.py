"""The bobber-agent: an immediate target that asks for no abrupt turn (Algorithm 2).

In the paper a virtual agent slides down a potential inside the cast-zone. The limit for a vanishing
weight of the zone's walls has a closed form (E7), which is used here: straight to a target that
lies in the cone, else to a point on the cone's edge on the target's side.
"""

from dataclasses import dataclass
from math import cos, sin, sqrt
from typing import Final, final

from agent.config import DEFAULT_CAST_FAR_M, Control
from agent.guidance.cone import Cone, azimuth_error
from agent.messages import Vector

STRAIGHT_AHEAD_M: Final = 0.1
"""A target nearer than this horizontally counts as straight ahead (E7)."""
INSIDE_EDGE: Final = 0.95
"""A bobber on the cone's edge stands at this share of the half angle, so that a neighbour's push
does not ask for a turn."""

MIN_CAST_RATIO: Final = 2.0
"""The least ratio of d_c2 to d_c1."""


@final
@dataclass
class CastZone:
    """The zone in which a bobber may be cast."""

    cone: Cone
    reach: float  # d_c2 [m]
    turning_radius: float  # R of E7 [m]


def lemma_7_bound_m(range_m: float, spacing_m: float) -> float:
    """Return the largest d_c2 [m] for a radio range d_c [m] and a spacing d_ir [m] (Lemma 7, E20).

    Agents that are out of range at the start of a cycle then stay d_ir apart throughout it.
    """
    return 0.25 * (range_m - spacing_m)


def cast_reach(control: Control, range_m: float, full_speed_m: float = 0.0) -> float:
    """Return d_c2 [m]: ``cast_far_m``, or where it is left out what the radio's range allows (E20).

    range_m: d_c [m], infinite where it is not known. full_speed_m: d_c2 at which the vehicle flies
    at its full speed [m]; given where the range is only the distance from which others were heard.
    The radio may reach farther than anybody is away, so that much is kept.
    """
    if control.cast_far_m is not None:
        return control.cast_far_m
    allowed = max(lemma_7_bound_m(range_m, control.spacing_m), full_speed_m)
    return max(min(DEFAULT_CAST_FAR_M, allowed), MIN_CAST_RATIO * control.cast_near_m)


def cast_zone(cone: Cone, reach: float, max_speed: float, max_yaw_rate: float) -> CastZone:
    """Return a vehicle's cast-zone. reach: d_c2 [m]; max_speed [m/s]; max_yaw_rate [rad/s]."""
    theta = min(cone)
    radius = max(0.5 * reach / (2.0 * sin(0.5 * theta)), max_speed / max_yaw_rate)
    return CastZone(cone, reach, radius)


def bobber(q: Vector, yaw: float, q_toq: Vector, zone: CastZone) -> Vector:
    """Return q_ba, the immediate target on the way to the target-on-queue [m; world frame].

    q, q_toq: own position and target-on-queue [m; world frame]; yaw: heading [rad]. A target inside
    the turning circle is the bobber itself, so that the vehicle turns on the spot towards it;
    otherwise the vehicle would orbit the target (E11).
    """
    x, y, z = q_toq[0] - q[0], q_toq[1] - q[1], q_toq[2] - q[2]
    across = sqrt(x * x + y * y)
    error = azimuth_error(x, y, yaw)
    if zone.cone.holds(error) or across < STRAIGHT_AHEAD_M or across < 2.0 * zone.turning_radius:
        scale = min(1.0, zone.reach / max(sqrt(x * x + y * y + z * z), 1e-12))
        return (q[0] + x * scale, q[1] + y * scale, q[2] + z * scale)
    step = 0.5 * zone.reach
    heading = yaw + INSIDE_EDGE * (zone.cone.left if error > 0.0 else -zone.cone.right)
    climb = min(max(z, -step), step)
    return (q[0] + step * cos(heading), q[1] + step * sin(heading), q[2] + climb)
