"""Flocking: a second, short controller, and an example of one (after Reynolds' three rules).

Keep apart, keep together, fly alike. Between two that hear each other the first two rules are a
spring of rest length ``spacing_m``, stiff when pressed and soft when stretched; a flock therefore
draws together until nearest neighbours are about ``spacing_m`` apart, and comes to rest. It has no
places and no formation; the agent around it keeps it safe and carries its words, as it does for any
controller.
"""

from math import dist, hypot

from agent.config import AgentSetup
from agent.controller import Heard, Intent, Senses
from agent.guidance.cone import cone_of
from agent.guidance.movement import saturated, steer
from agent.messages import ZERO, Vector

APART = 4.0
"""Speed away for each metre that another is nearer than ``spacing_m`` [1/s]."""
TOGETHER = 0.05
"""Speed towards it for each metre that it is farther off [1/s]."""
ALIKE = 0.5
"""Share of another's velocity to fly along with."""


class Flocking:
    """Flies one agent in a flock whose members keep about ``spacing_m`` apart."""

    def __init__(self, setup: AgentSetup) -> None:
        self._limits = (setup.vehicle.max_speed_mps, setup.vehicle.max_climb_mps)
        self._cone = cone_of(setup.vehicle)
        self._spacing = setup.control.spacing_m

    def decide(self, senses: Senses) -> Intent:
        """Return what to do now: the mean of what each neighbour asks for; alone, hover."""
        x, y, z = senses.position
        pulls = [self._pull(senses.position, other) for other in senses.neighbours]
        pull = mean(pulls) if pulls else ZERO
        wanted = saturated(pull, *self._limits)
        velocity, yaw = steer(wanted, senses.yaw, self._cone)
        ahead = (x + wanted[0], y + wanted[1], z + wanted[2])
        return Intent(wanted, velocity, yaw, force=hypot(*pull), heading_for=ahead)

    def _pull(self, q: Vector, other: Heard) -> Vector:
        """Return the velocity that one neighbour asks for [m/s; world frame]."""
        p, v = other.position, other.velocity
        r = dist(q, p)
        stretch = r - self._spacing
        towards = (TOGETHER if stretch > 0.0 else APART) * stretch / max(r, 1e-6)
        return (
            towards * (p[0] - q[0]) + ALIKE * v[0],
            towards * (p[1] - q[1]) + ALIKE * v[1],
            towards * (p[2] - q[2]) + ALIKE * v[2],
        )


def mean(vectors: list[Vector]) -> Vector:
    """Return the mean of some vectors, at least one."""
    x, y, z = (sum(axis) / len(vectors) for axis in zip(*vectors, strict=True))
    return (x, y, z)
