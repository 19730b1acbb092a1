"""Lengths and turns of vectors in plain floats.

Compiled code calls the lengths without making objects. They differ from math.dist by rounding
alone, and serve decisions: what is flown is computed by math.dist and hypot.
"""

from collections.abc import Iterable
from math import cos, sin, sqrt

from agent.messages import Vector


def apart(a: Vector, b: Vector) -> float:
    """Return the distance between two points."""
    x, y, z = a[0] - b[0], a[1] - b[1], a[2] - b[2]
    return sqrt(x * x + y * y + z * z)


def length(vector: Vector) -> float:
    """Return the length of a vector."""
    x, y, z = vector
    return sqrt(x * x + y * y + z * z)


def across(vector: Vector) -> float:
    """Return the length of a vector's horizontal part."""
    return sqrt(vector[0] * vector[0] + vector[1] * vector[1])


def turned(vectors: Iterable[Vector], yaw: float) -> list[Vector]:
    """Return vectors of a level body's axes in the world's axes; yaw: its heading [rad]."""
    c, s = cos(yaw), sin(yaw)
    return [(c * x - s * y, s * x + c * y, z) for x, y, z in vectors]
