"""Giving way to what comes nearer by itself: the limit towards it is then negative.

A vehicle that only went straight back would be driven along in front of it. So it goes back as fast
as it must and, with the speed that is left, aside: against the way on which the surface goes past
it, which leads round it, and where it comes straight, over what is lower or under what is higher.
What may not be done towards others still holds: a way aside that leads into them is not taken.
Such a way may leave the cone, which is a rule of guidance, not of the vehicle (E7).
"""

from collections.abc import Sequence
from math import hypot, sqrt

from agent.guidance.movement import saturated
from agent.guidance.safety_filter import Bound, approach_of, slid
from agent.messages import Vector

UPRIGHT = 0.999
"""What comes from so steep above or below has no way over it or under it."""
PAST = 0.1
"""Sine of the angle within which something comes straight at one."""
ENOUGH_MPS = 1e-6


def retreated(
    velocity: Vector, bounds: Sequence[Bound], max_speed: float, max_climb: float
) -> Vector:
    """Return a velocity [m/s] that keeps the bounds, the negative ones as far as it can.

    Of the ways that give way enough the first is flown: aside, as was wanted, straight back.
    """
    firm = [bound for bound in bounds if bound.limit >= 0.0]
    duties = [bound for bound in bounds if bound.limit < 0.0]
    worst = min(duties, key=lambda bound: bound.limit)
    ways = [*_aside(worst, max_speed), velocity, _times(max_speed, worst.away)]
    flown = [slid(saturated(slid(way, bounds), max_speed, max_climb), firm) for way in ways]
    return min(flown, key=lambda way: _shortfall(way, duties))


def _aside(duty: Bound, max_speed: float) -> list[Vector]:
    """Return the ways round what comes, the best first [m/s]."""
    n, back = duty.away, min(-duty.limit, max_speed)
    rest = sqrt(max_speed * max_speed - back * back)
    return [
        (back * n[0] + rest * t[0], back * n[1] + rest * t[1], back * n[2] + rest * t[2])
        for t in _tangents(duty)
    ]


def _tangents(duty: Bound) -> list[Vector]:
    """Return unit vectors along what comes: round it, over or under it, to its sides."""
    n, (u, v, w) = duty.away, duty.coming
    left = _unit((-n[1], n[0], 0.0)) if abs(n[2]) < UPRIGHT else (1.0, 0.0, 0.0)
    over = (
        n[1] * left[2] - n[2] * left[1],
        n[2] * left[0] - n[0] * left[2],
        n[0] * left[1] - n[1] * left[0],
    )
    over = _times(1.0 if n[2] >= 0.0 else -1.0, over)
    found = [over, left, _times(-1.0, left), _times(-1.0, over)]
    speed = u * n[0] + v * n[1] + w * n[2]
    past = (speed * n[0] - u, speed * n[1] - v, speed * n[2] - w)
    return [_unit(past), *found] if hypot(*past) > PAST * hypot(u, v, w) else found


def _shortfall(velocity: Vector, duties: Sequence[Bound]) -> float:
    """Return by how much a velocity misses the worst of its duties [m/s]; 0 for next to nothing."""
    missed = max(approach_of(velocity, duty) - duty.limit for duty in duties)
    return missed if missed > ENOUGH_MPS else 0.0


def _times(scale: float, vector: Vector) -> Vector:
    return (scale * vector[0], scale * vector[1], scale * vector[2])


def _unit(vector: Vector) -> Vector:
    return _times(1.0 / hypot(*vector), vector)
