"""Vehicles that move only where they point: the filter may only shorten what they fly.

Until a command expires such a vehicle may have turned by its yaw rate, whatever it was told last:
each bound is kept for every heading within that. They cannot fly back: from what comes nearer by
itself they climb or sink, and go ahead where that leads away.
"""

from collections.abc import Sequence
from math import atan2, cos, hypot, inf, pi, sin, sqrt

from agent.guidance.safety_filter import ROUNDING_MPS, Bound
from agent.messages import Vector


def ahead(velocity: Vector, yaw: float) -> tuple[float, float]:
    """Return what of a velocity a vehicle can fly: forward and upward [m/s]."""
    return max(0.0, velocity[0] * cos(yaw) + velocity[1] * sin(yaw)), velocity[2]


def forward_kept(velocity: Vector, bounds: Sequence[Bound], yaw: float, sway: float) -> Vector:
    """Return a velocity along the heading that keeps every bound [m/s].

    sway: how far the heading may turn either way before the command expires [rad]. Of the way ahead
    shortened, and of the climb alone, the faster is flown.
    """
    forward, climb = ahead(velocity, yaw)
    both = _scale(forward, climb, bounds, yaw, sway)
    up = _scale(0.0, climb, bounds, yaw, sway)
    if up * abs(climb) > both * hypot(forward, climb):
        return (0.0, 0.0, up * climb)
    forward, climb = both * forward, both * climb
    return (forward * cos(yaw), forward * sin(yaw), climb)


def forward_retreat(
    bounds: Sequence[Bound], yaw: float, sway: float, max_speed: float, max_climb: float
) -> Vector:
    """Return the velocity that best gives way to what comes nearer [m/s]; others it lets be."""
    firm = [bound for bound in bounds if bound.limit >= 0.0]
    duties = [bound for bound in bounds if bound.limit < 0.0]
    climb = min(max_climb, max_speed)
    ahead_too = sqrt(max_speed * max_speed - climb * climb)
    flown = []
    for forward, up in ((0.0, climb), (0.0, -climb), (ahead_too, climb), (ahead_too, -climb)):
        share = _scale(forward, up, firm, yaw, sway)
        flown.append((share * forward, share * up))
    flown.append((_scale(max_speed, 0.0, firm, yaw, sway) * max_speed, 0.0))
    forward, up = min(flown, key=lambda way: _shortfall(way, duties, yaw, sway))
    return (forward * cos(yaw), forward * sin(yaw), up)


def _shortfall(way: tuple[float, float], duties: Sequence[Bound], yaw: float, sway: float) -> float:
    """Return by how much a flight ahead and upward misses the worst of its duties [m/s]."""
    return max(_worst_approach(*way, duty.away, yaw, sway) - duty.limit for duty in duties)


def _scale(forward: float, climb: float, bounds: Sequence[Bound], yaw: float, sway: float) -> float:
    """Return the greatest share of a flight that keeps every bound."""
    scale = 1.0
    for bound in bounds:
        approach = _worst_approach(forward, climb, bound.away, yaw, sway)
        limit = max(0.0, bound.limit)
        if approach * scale > limit + ROUNDING_MPS:
            scale = limit / approach
        if bound.aside < inf:
            square = forward * forward + climb * climb
            retreat = max(0.0, -approach)
            across = sqrt(max(0.0, square - retreat * retreat))
            if across * scale > bound.aside + ROUNDING_MPS:
                scale = bound.aside / across
    return scale


def _worst_approach(forward: float, climb: float, away: Vector, yaw: float, sway: float) -> float:
    """Return the greatest speed towards a body over all headings within reach [m/s]."""
    x, y, z = away
    error = atan2(-y, -x) - yaw
    off = abs(error - 2.0 * pi * round(error / (2.0 * pi)))
    return forward * hypot(x, y) * cos(max(0.0, off - sway)) - climb * z
