"""Points of a queue by arc length: the one nearest to a position, and those on a sphere."""

from math import dist, inf
from typing import Final

from agent.messages import Vector
from agent.qstructure.curve import CurveError
from agent.qstructure.expression import ExpressionError
from agent.qstructure.queue import Queue

STEP_M: Final = 0.25
FINE_M: Final = 0.002
FAR: Final[Vector] = (inf, inf, inf)
"""Instead of a point that cannot be computed."""


def end_m(queue: Queue, members: int, spacing_m: float) -> float:
    """Return up to which arc length agents look at a queue [m].

    A closed queue ends at its last vertex; an open one has room for twice as many members.
    """
    return queue.stations[-1] if queue.closed else 2.0 * spacing_m * max(members, 1)


def point(queue: Queue, s: float) -> Vector:
    """Return the point at arc length s [m; target's frame]; FAR where there is none."""
    try:
        return queue.point(s)
    except (CurveError, ExpressionError):
        return FAR


def nearest(queue: Queue, position: Vector, until_m: float, near: float | None = None) -> float:
    """Return the arc length nearest to a position [m], to FINE_M.

    position [m; target's frame]; until_m: end of the search [m]; near: an arc length to search from
    [m], else the whole queue is looked at.
    """
    if near is None:
        steps = int(until_m / STEP_M) + 1
        s = min((dist(point(queue, k * STEP_M), position), k * STEP_M) for k in range(steps))[1]
    else:
        s = min(near, until_m)
    step, least = STEP_M, dist(point(queue, s), position)
    while step > FINE_M:
        moved = False
        for other in (max(0.0, s - step), min(until_m, s + step)):
            away = dist(point(queue, other), position)
            if away < least:
                s, least, moved = other, away, True
        if not moved:
            step *= 0.5
    return s


def on_sphere(queue: Queue, centre: Vector, radius: float, until_m: float) -> list[Vector]:
    """Return the points of a queue at a distance from a centre, to FINE_M [m; target's frame]."""
    found = list[Vector]()
    s, before = 0.0, dist(point(queue, 0.0), centre) - radius
    while s < until_m:
        after = dist(point(queue, s + STEP_M), centre) - radius
        if before * after <= 0.0 and after < inf:
            found.append(point(queue, _crossing(queue, centre, radius, s)))
        s, before = s + STEP_M, after
    return found


def _crossing(queue: Queue, centre: Vector, radius: float, low: float) -> float:
    """Return where a queue crosses a sphere within STEP_M from an arc length on [m]."""
    high = low + STEP_M
    inside = dist(point(queue, low), centre) < radius
    while high - low > FINE_M:
        middle = 0.5 * (low + high)
        if (dist(point(queue, middle), centre) < radius) == inside:
            low = middle
        else:
            high = middle
    return 0.5 * (low + high)
