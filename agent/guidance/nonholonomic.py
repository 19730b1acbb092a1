"""Vehicles that fly only where they point: the safety filter may only shorten their velocity.

Until a command expires such a vehicle may have turned at its yaw rate, whatever its last command
was. So each bound is kept for every heading within that turn. These vehicles cannot fly back: they
climb or sink out of the way of an approaching surface, and go ahead where that leads away from it.
"""

from collections.abc import Sequence
from math import atan2, cos, hypot, inf, pi, sin, sqrt

from agent.guidance.safety_filter import ROUNDING_MPS, Bound
from agent.messages import Vector


def forward_and_climb(velocity: Vector, yaw: float) -> tuple[float, float]:
    """Return the parts of a velocity that the vehicle can fly: forward and upward [m/s]."""
    return max(0.0, velocity[0] * cos(yaw) + velocity[1] * sin(yaw)), velocity[2]


def forward_limited(velocity: Vector, bounds: Sequence[Bound], yaw: float, turn: float) -> Vector:
    """Return a velocity along the heading that keeps every bound [m/s].

    turn: how far the heading may turn either way before the command expires [rad]. The result is
    the faster one of the whole velocity shortened and of its climb alone.
    """
    forward, climb = forward_and_climb(velocity, yaw)
    both = _scale(forward, climb, bounds, yaw, turn)
    up = _scale(0.0, climb, bounds, yaw, turn)
    if up * abs(climb) > both * hypot(forward, climb):
        return (0.0, 0.0, up * climb)
    forward, climb = both * forward, both * climb
    return (forward * cos(yaw), forward * sin(yaw), climb)


def forward_evasion(
    bounds: Sequence[Bound], yaw: float, turn: float, max_speed: float, max_climb: float
) -> Vector:
    """Return the velocity that best evades approaching surfaces and keeps other bounds [m/s]."""
    firm = [bound for bound in bounds if bound.limit >= 0.0]
    retreats = [bound for bound in bounds if bound.limit < 0.0]
    climb = min(max_climb, max_speed)
    ahead_too = sqrt(max_speed * max_speed - climb * climb)
    flown = []
    for forward, up in ((0.0, climb), (0.0, -climb), (ahead_too, climb), (ahead_too, -climb)):
        share = _scale(forward, up, firm, yaw, turn)
        flown.append((share * forward, share * up))
    flown.append((_scale(max_speed, 0.0, firm, yaw, turn) * max_speed, 0.0))
    forward, up = min(flown, key=lambda way: _shortfall(way, retreats, yaw, turn))
    return (forward * cos(yaw), forward * sin(yaw), up)


def _shortfall(
    way: tuple[float, float], retreats: Sequence[Bound], yaw: float, turn: float
) -> float:
    """Return by how much (forward, upward) speeds miss the worst retreat [m/s]."""
    return max(_worst_approach(*way, bound.away, yaw, turn) - bound.limit for bound in retreats)


def _scale(forward: float, climb: float, bounds: Sequence[Bound], yaw: float, turn: float) -> float:
    """Return the greatest share of (forward, climb) speeds that keeps every bound."""
    scale = 1.0
    for bound in bounds:
        approach = _worst_approach(forward, climb, bound.away, yaw, turn)
        limit = max(0.0, bound.limit)
        if approach * scale > limit + ROUNDING_MPS:
            scale = limit / approach
        if bound.across_limit < inf:
            square = forward * forward + climb * climb
            retreat = max(0.0, -approach)
            across = sqrt(max(0.0, square - retreat * retreat))
            beside = across - bound.leaving * retreat
            if beside * scale > bound.across_limit + ROUNDING_MPS:
                scale = bound.across_limit / beside
    return scale


def _worst_approach(forward: float, climb: float, away: Vector, yaw: float, turn: float) -> float:
    """Return the greatest approach speed over all headings within reach [m/s]."""
    x, y, z = away
    error = atan2(-y, -x) - yaw
    off = abs(error - 2.0 * pi * round(error / (2.0 * pi)))
    return forward * hypot(x, y) * cos(max(0.0, off - turn)) - climb * z
