"""Lengths of vectors in plain floats, for decisions: they differ from math.dist by rounding alone.

Compiled code calls these without making objects. What is flown is computed by math.dist and hypot.
"""

from math import sqrt

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
