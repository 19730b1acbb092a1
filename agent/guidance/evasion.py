"""Evasion of an approaching surface: a bound whose limit is negative asks for a retreat.

A vehicle that only went straight back would be driven along in front of the surface. So it retreats
as fast as it must and, with the remaining speed, goes aside: against the direction in which the
surface passes it, which leads round the surface, and if the surface comes straight, over a lower
one or under a higher one. The other bounds still hold: a way aside that breaks them is not taken.
Such a way may leave the cone, which is a rule of guidance and not a limit of the vehicle (E7).
"""

from collections.abc import Sequence
from math import hypot, sqrt
from typing import Final

from agent.guidance.movement import saturated
from agent.guidance.safety_filter import Bound, approach_of, slid
from agent.messages import ZERO, Vector

UPRIGHT: Final = 0.999
"""Sine of the elevation from which an approach leaves no way over or under."""
STRAIGHT: Final = 0.1
"""Sine of the angle up to which a surface comes straight at the vehicle."""
NEGLIGIBLE_MPS: Final = 1e-6


def evasive_velocity(
    velocity: Vector, bounds: Sequence[Bound], max_speed: float, max_climb: float
) -> Vector:
    """Return a velocity that keeps the bounds, negative ones as far as it can [m/s].

    Of the ways that retreat fast enough the first is flown: aside of a moving surface, as wanted,
    straight back.
    """
    firm = [_not_approached(each) for each in bounds if _is_firm(each)]
    retreats = [bound for bound in bounds if bound.limit < 0.0]
    worst = min(retreats, key=lambda bound: bound.limit)
    ways = [velocity, _scaled(max_speed, worst.away)]
    if worst.surface_velocity != ZERO:
        ways = [*_ways_aside(worst, max_speed), *ways]
    flown = [slid(saturated(slid(way, bounds), max_speed, max_climb), firm) for way in ways]
    return min(flown, key=lambda way: _shortfall(way, retreats))


def _is_firm(bound: Bound) -> bool:
    """Whether a bound holds in any case: no surface at rest is approached to evade another one."""
    return bound.limit >= 0.0 or bound.surface_velocity == ZERO


def _not_approached(bound: Bound) -> Bound:
    return bound if bound.limit >= 0.0 else bound._replace(limit=0.0)


def _ways_aside(retreat: Bound, max_speed: float) -> list[Vector]:
    """Return the velocities that retreat and go round the surface, the best first [m/s]."""
    n, back = retreat.away, min(-retreat.limit, max_speed)
    rest = sqrt(max_speed * max_speed - back * back)
    return [
        (back * n[0] + rest * t[0], back * n[1] + rest * t[1], back * n[2] + rest * t[2])
        for t in _tangents(retreat)
    ]


def _tangents(retreat: Bound) -> list[Vector]:
    """Return unit vectors across the line to the surface: round, over or under, to the sides."""
    n, (u, v, w) = retreat.away, retreat.surface_velocity
    left = _unit((-n[1], n[0], 0.0)) if abs(n[2]) < UPRIGHT else (1.0, 0.0, 0.0)
    over = (
        n[1] * left[2] - n[2] * left[1],
        n[2] * left[0] - n[0] * left[2],
        n[0] * left[1] - n[1] * left[0],
    )
    over = _scaled(1.0 if n[2] >= 0.0 else -1.0, over)
    found = [over, left, _scaled(-1.0, left), _scaled(-1.0, over)]
    speed = u * n[0] + v * n[1] + w * n[2]
    past = (speed * n[0] - u, speed * n[1] - v, speed * n[2] - w)
    return [_unit(past), *found] if hypot(*past) > STRAIGHT * hypot(u, v, w) else found


def _shortfall(velocity: Vector, retreats: Sequence[Bound]) -> float:
    """Return by how much a velocity misses the worst retreat [m/s]; 0 if negligible."""
    missed = max(approach_of(velocity, bound) - bound.limit for bound in retreats)
    return missed if missed > NEGLIGIBLE_MPS else 0.0


def _scaled(scale: float, vector: Vector) -> Vector:
    return (scale * vector[0], scale * vector[1], scale * vector[2])


def _unit(vector: Vector) -> Vector:
    return _scaled(1.0 / hypot(*vector), vector)
