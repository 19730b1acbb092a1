"""A queue's curve by arc length, measured by the judge itself.

Agents compute where they must stand. The judge shares with them the tables of a formation file and
the language of expressions, and none of their geometry: a place that agents get wrong is wrong.
Lines, arcs and helices have a closed form; other curves are chains of points a few millimetres
apart, measured by their chords.
"""

from collections.abc import Callable
from math import dist, inf, tau
from typing import assert_never

import numpy as np

from agent.messages import Vector
from agent.qstructure.expression import Expression, ExpressionError
from agent.qstructure.shape import Arc, Curve, Helix, Polyline, Ray, ShapeSpec, Spline
from worldsim.truth.vehicle import Floats

CHORD_M = 0.004
"""About the distance of two points of a chain [m]."""
AHEAD_M = 1e-4
"""A spline goes on so far in its last direction, in which it then continues [m]."""
MAX_POINTS = 400_000
"""A curve that needs a longer chain is not measured."""

Track = Callable[[Floats], Floats]
"""From arc lengths (K,) [m] to points (K, 3) [m], relative to the curve's start."""


class UnmeasuredError(ValueError):
    """A curve that the judge cannot measure."""


def track_of(shape: ShapeSpec, until_m: float) -> Track:
    """Return a shape's curve up to an arc length [m]. Raises UnmeasuredError."""
    match shape:
        case Ray():
            return chain_track(np.array([(0.0, 0.0, 0.0), shape.direction]))
        case Polyline():
            return chain_track(np.array(shape.points_m))
        case Arc():
            return _arc(shape)
        case Helix():
            return _helix(shape)
        case Spline():
            return chain_track(_spline(np.array(shape.points_m)))
        case Curve():
            return chain_track(_marched(shape, until_m))
    assert_never(shape)


def chain_track(chain: Floats) -> Track:
    """Return the curve along a chain of points (K, 3) [m]; it continues straight at its end."""
    chain = chain - chain[0]
    steps = np.linalg.norm(np.diff(chain, axis=0), axis=1)
    lengths = np.concatenate(([0.0], np.cumsum(steps)))
    onward = (chain[-1] - chain[-2]) / steps[-1]

    def at(s: Floats) -> Floats:
        beyond = np.maximum(s - lengths[-1], 0.0)
        inside = [np.interp(s, lengths, axis) for axis in chain.T]
        points: Floats = np.stack(inside, axis=1) + beyond[:, None] * onward
        return points

    return at


def _arc(shape: Arc) -> Track:
    """Return a level circle through the start, which it leaves towards the heading."""
    turn = np.copysign(1.0 / shape.radius_m, shape.sweep_deg)
    heading = np.radians(shape.heading_deg)
    length_m = abs(np.radians(shape.sweep_deg)) * shape.radius_m

    def at(s: Floats) -> Floats:
        along = np.minimum(s, length_m)
        course = heading + turn * along
        beyond = np.maximum(s - length_m, 0.0)
        x = (np.sin(course) - np.sin(heading)) / turn + beyond * np.cos(course)
        y = (np.cos(heading) - np.cos(course)) / turn + beyond * np.sin(course)
        points: Floats = np.stack((x, y, np.zeros_like(s)), axis=1)
        return points

    return at


def _helix(shape: Helix) -> Track:
    heading = np.radians(shape.heading_deg)
    per_turn_m = np.hypot(tau * shape.radius_m, shape.pitch_m)

    def at(s: Floats) -> Floats:
        turns = s / per_turn_m
        course = heading + tau * turns
        x = shape.radius_m * (np.sin(course) - np.sin(heading))
        y = shape.radius_m * (np.cos(heading) - np.cos(course))
        points: Floats = np.stack((x, y, shape.pitch_m * turns), axis=1)
        return points

    return at


def _spline(points: Floats) -> Floats:
    """Return a chain along the centripetal Catmull-Rom spline, each piece as a cubic of Hermite.

    The end pieces have the mirrored neighbour as their outer point.
    """
    padded = np.concatenate(
        ([2.0 * points[0] - points[1]], points, [2.0 * points[-1] - points[-2]])
    )
    knots = np.concatenate(
        ([0.0], np.cumsum(np.sqrt(np.linalg.norm(np.diff(padded, axis=0), axis=1))))
    )
    chain = [points[:1]]
    for k in range(1, len(padded) - 2):
        (p0, p1, p2, p3), (t0, t1, t2, t3) = padded[k - 1 : k + 3], knots[k - 1 : k + 3]
        span = t2 - t1
        direct = (p2 - p1) / span
        leaves = (p1 - p0) / (t1 - t0) - (p2 - p0) / (t2 - t0) + direct
        comes = direct - (p3 - p1) / (t3 - t1) + (p3 - p2) / (t3 - t2)
        count = _count(2.0 * float(np.linalg.norm(p2 - p1)))
        u = np.linspace(0.0, 1.0, count + 1)[1:, None]
        chain.append(
            (1.0 + 2.0 * u) * (1.0 - u) ** 2 * p1
            + u * (1.0 - u) ** 2 * span * leaves
            + u * u * (3.0 - 2.0 * u) * p2
            + u * u * (u - 1.0) * span * comes
        )
    ahead = comes / np.linalg.norm(comes)
    return np.concatenate([*chain, [points[-1] + AHEAD_M * ahead]])


def _count(length_m: float) -> int:
    count = int(length_m / CHORD_M) + 1
    if count > MAX_POINTS:
        raise UnmeasuredError(f"{length_m:.0f} m are too long")
    return count


def _marched(shape: Curve, until_m: float) -> Floats:
    """Return a chain along a curve of expressions, by steps as long as its speed allows."""
    x, y, z = (Expression(text, "s") for text in (shape.x, shape.y, shape.z))

    def at(parameter: float) -> Vector:
        return (x(parameter), y(parameter), z(parameter))

    try:
        parameter, step, length_m, chain = 0.0, CHORD_M, 0.0, [at(0.0)]
        while length_m < until_m:
            there = at(parameter + step)
            chord_m = dist(chain[-1], there)
            if chord_m > 2.0 * CHORD_M:
                step *= 0.5
                _check_steps(len(chain), step)
                continue
            parameter, length_m = parameter + step, length_m + chord_m
            chain.append(there)
            _check_steps(len(chain), step)
            if chord_m < CHORD_M:
                step *= 1.5
    except ExpressionError as error:
        raise UnmeasuredError(str(error)) from error
    return np.array(chain)


def _check_steps(points: int, step: float) -> None:
    if points > MAX_POINTS or not 1e-12 < step < inf:
        raise UnmeasuredError("the curve jumps, stands still or is too long")
