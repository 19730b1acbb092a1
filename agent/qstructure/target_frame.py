"""The target's frame, in which a formation's vertices stand (footnote 1 of the paper)."""

from math import cos, sin

from agent.messages import ZERO, Vector


class Frame:
    """The frame at one time: at ``origin`` [m; world frame], turned by ``yaw`` [rad] about +z.

    velocity: of the origin [m/s; world frame]; yaw_rate [rad/s]. ``moves``: whether any is not 0.
    """

    __slots__ = ("_cos", "_sin", "moves", "origin", "velocity", "yaw", "yaw_rate")

    def __init__(
        self,
        origin: Vector = ZERO,
        yaw: float = 0.0,
        velocity: Vector = ZERO,
        yaw_rate: float = 0.0,
    ) -> None:
        self.origin = origin
        self.yaw = yaw
        self.velocity = velocity
        self.yaw_rate = yaw_rate
        self.moves = yaw_rate != 0.0 or velocity != ZERO
        self._cos = cos(yaw)
        self._sin = sin(yaw)

    def to_world(self, point: Vector) -> Vector:
        """Return a point of this frame [m] in world coordinates [m]."""
        x, y, z = point
        return (
            self.origin[0] + self._cos * x - self._sin * y,
            self.origin[1] + self._sin * x + self._cos * y,
            self.origin[2] + z,
        )

    def to_frame(self, point: Vector) -> Vector:
        """Return a point in world coordinates [m] in this frame [m]."""
        x, y = point[0] - self.origin[0], point[1] - self.origin[1]
        return (
            self._cos * x + self._sin * y,
            self._cos * y - self._sin * x,
            point[2] - self.origin[2],
        )

    def velocity_at(self, point: Vector) -> Vector:
        """Return the velocity of a point at rest in this frame: v + w x r [m/s; world frame].

        point [m; world frame].
        """
        x, y = point[0] - self.origin[0], point[1] - self.origin[1]
        u, v, w = self.velocity
        return (u - self.yaw_rate * y, v + self.yaw_rate * x, w)
