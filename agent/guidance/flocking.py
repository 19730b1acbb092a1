"""Flocking: a second, short controller as an example (after Reynolds' three rules).

The rules are separation, cohesion and alignment. Between two agents that hear each other the first
two are a spring of rest length ``spacing_m``, stiff when pressed and soft when stretched. So a
flock draws together until nearest neighbours are about ``spacing_m`` apart, and comes to rest. It
has no places and no formation. As for any controller, the agent around it keeps it safe and sends
its messages.
"""

from math import dist, hypot
from typing import Final

from agent.config import AgentSetup
from agent.controller import Heard, Intent, Senses
from agent.guidance.cone import cone_of
from agent.guidance.movement import saturated, steer
from agent.messages import ZERO, Vector

SEPARATION_HZ: Final = 4.0
"""Speed away for each metre that a neighbour is nearer than ``spacing_m`` [1/s]."""
COHESION_HZ: Final = 0.05
"""Speed towards a neighbour for each metre that it is farther than ``spacing_m`` [1/s]."""
ALIGNMENT: Final = 0.5
"""Share of a neighbour's velocity that is added."""


class Flocking:
    """Flies one agent in a flock whose members keep about ``spacing_m`` apart."""

    def __init__(self, setup: AgentSetup) -> None:
        self._limits = (setup.vehicle.max_speed_mps, setup.vehicle.max_climb_mps)
        self._cone = cone_of(setup.vehicle)
        self._spacing = setup.control.spacing_m

    def decide(self, senses: Senses) -> Intent:
        """Return the intent: the mean of the neighbours' pulls; without neighbours, hover."""
        x, y, z = senses.position
        pulls = [self._pull(senses.position, other) for other in senses.neighbours]
        pull = mean(pulls) if pulls else ZERO
        wanted = saturated(pull, *self._limits)
        velocity, yaw = steer(wanted, senses.yaw, self._cone)
        ahead = (x + wanted[0], y + wanted[1], z + wanted[2])
        return Intent(wanted, velocity, yaw, force=hypot(*pull), heading_for=ahead)

    def _pull(self, q: Vector, other: Heard) -> Vector:
        """Return the velocity that one neighbour adds [m/s; world frame]."""
        p, v = other.position, other.velocity
        r = dist(q, p)
        stretch = r - self._spacing
        towards = (COHESION_HZ if stretch > 0.0 else SEPARATION_HZ) * stretch / max(r, 1e-6)
        return (
            towards * (p[0] - q[0]) + ALIGNMENT * v[0],
            towards * (p[1] - q[1]) + ALIGNMENT * v[1],
            towards * (p[2] - q[2]) + ALIGNMENT * v[2],
        )


def mean(vectors: list[Vector]) -> Vector:
    """Return the mean of at least one vector."""
    x, y, z = (sum(axis) / len(vectors) for axis in zip(*vectors, strict=True))
    return (x, y, z)
