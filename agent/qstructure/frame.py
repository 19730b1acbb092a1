"""The target's frame, in which a formation's vertices stand (footnote 1 of the paper)."""

from math import cos, sin

from agent.messages import Vector


class Frame:
    """A frame that stands at ``origin`` [m; world frame], turned by ``yaw`` [rad] about +z."""

    __slots__ = ("_cos", "_sin", "origin", "yaw")

    def __init__(self, origin: Vector = (0.0, 0.0, 0.0), yaw: float = 0.0) -> None:
        self.origin = origin
        self.yaw = yaw
        self._cos = cos(yaw)
        self._sin = sin(yaw)

    def to_world(self, point: Vector) -> Vector:
        """Return a point of this frame [m] in the world frame [m]."""
        x, y, z = point
        return (
            self.origin[0] + self._cos * x - self._sin * y,
            self.origin[1] + self._sin * x + self._cos * y,
            self.origin[2] + z,
        )
