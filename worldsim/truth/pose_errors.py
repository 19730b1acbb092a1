"""Poses that are measured wrong: a bias of position and yaw, and noise, until they are right again.

Position comes from outside, as by GPS: its error is in world axes. A wrong yaw turns all that the
vehicle measures in its own axes into wrong world axes, and all that it flies back: its sensors'
readings, its velocity and its commands. Noise is keyed by (seed, agent, slot), as all noise is.
"""

from math import cos, fmod, hypot, sin, tau
from typing import Final, NamedTuple

import numpy as np

from agent.messages import ZERO, Vector

KEY_SALT: Final = 1 << 61


class PoseError(NamedTuple):
    """The error that one fault puts on a measured pose."""

    bias: Vector  # of the position [m; world frame]
    noise_m: float  # standard deviation of the position on each axis [m]
    yaw: float  # bias [rad]


class MeasuredPose(NamedTuple):
    """A pose as an agent measures it."""

    position: Vector  # [m; world frame]
    yaw: float  # [rad; world frame]


class PoseErrors:
    """How wrong each agent measures its pose.

    The biases of faults in force together add up, and so do the variances of their noise.
    """

    def __init__(self, seed: int) -> None:
        self._seed = seed
        self._errors: dict[int, dict[int, PoseError]] = {}
        """By agent and the fault's number."""
        self._sums: dict[int, PoseError] = {}
        self.struck: dict[int, int] = {}
        """How many poses each fault made wrong, by its number."""

    def redraw(self, seed: int) -> None:
        """Draw later noise from another seed; faults in force stay."""
        self._seed = seed

    def __bool__(self) -> bool:
        return bool(self._errors)

    def begin(self, number: int, agent: int, error: PoseError) -> None:
        """Begin a fault of an agent's pose."""
        self._errors.setdefault(agent, {})[number] = error
        self._sums[agent] = _sum(self._errors[agent])

    def end(self, number: int, agent: int) -> None:
        """End a fault of an agent's pose."""
        errors = self._errors.get(agent, {})
        errors.pop(number, None)
        if errors:
            self._sums[agent] = _sum(errors)
        else:
            self._errors.pop(agent, None)
            self._sums.pop(agent, None)

    def measured(self, agent: int, position: Vector, yaw: float, slot: int) -> MeasuredPose:
        """Return an agent's pose as it measures it in a slot, and count it."""
        error = self._sums.get(agent)
        if error is None:
            return MeasuredPose(position, yaw)
        for number in self._errors[agent]:
            self.struck[number] = self.struck.get(number, 0) + 1
        x, y, z = position
        (u, v, w), (a, b, c) = error.bias, self._noise(agent, slot, error.noise_m)
        turned = fmod(yaw + error.yaw + tau, tau)
        return MeasuredPose((x + u + a, y + v + b, z + w + c), turned)

    def turned(self, agent: int, vector: Vector) -> Vector:
        """Return what an agent takes for the world axes of a vector measured in its own axes."""
        return _turned(vector, self._yaw(agent))

    def turned_back(self, agent: int, vector: Vector) -> Vector:
        """Return what an agent flies that wants a vector in what it takes for the world axes."""
        return _turned(vector, -self._yaw(agent))

    def yaw_back(self, agent: int, yaw: float) -> float:
        """Return the true yaw [rad] of an agent that measures ``yaw``."""
        return fmod(yaw - self._yaw(agent) + tau, tau)

    def turns(self, agent: int) -> bool:
        """Return whether an agent measures its yaw wrong."""
        return self._yaw(agent) != 0.0

    def _yaw(self, agent: int) -> float:
        error = self._sums.get(agent)
        return error.yaw if error is not None else 0.0

    def _noise(self, agent: int, slot: int, noise_m: float) -> Vector:
        if noise_m == 0.0:
            return ZERO
        key = [self._seed, KEY_SALT | agent << 40 | slot]
        drawn = np.random.Generator(np.random.Philox(key=key)).standard_normal(3).tolist()
        return (noise_m * drawn[0], noise_m * drawn[1], noise_m * drawn[2])


def _sum(errors: dict[int, PoseError]) -> PoseError:
    """Return the error of several faults together."""
    x = y = z = noise_m = yaw = 0.0
    for (u, v, w), each_m, each_yaw in errors.values():
        x, y, z, yaw = x + u, y + v, z + w, yaw + each_yaw
        noise_m = hypot(noise_m, each_m)
    return PoseError((x, y, z), noise_m, fmod(yaw, tau))


def _turned(vector: Vector, yaw: float) -> Vector:
    if yaw == 0.0:
        return vector
    x, y, z = vector
    along, across = cos(yaw), sin(yaw)
    return (along * x - across * y, across * x + along * y, z)
