"""Flocking: a second, short controller, and an example of one (after Reynolds' three rules).

Keep apart, keep together, fly alike. It has no places and no formation; the agent around it keeps
it safe and carries its words, as it does for any controller.
"""

from math import hypot, pi

from agent.controller import Heard, Intent, Senses
from agent.guidance.cone import cone_of
from agent.guidance.movement import saturated, steer
from agent.messages import Vector
from agent.setup import AgentSetup

APART, TOGETHER, ALIKE = 1.0, 0.05, 0.5
"""Weights of the three rules: [m^2/s], [1/s], and of the neighbours' mean velocity."""


class Flocking:
    """Flies one agent in a flock whose members keep about ``spacing_m`` apart."""

    def __init__(self, setup: AgentSetup) -> None:
        self._vehicle = setup.vehicle
        self._spacing = setup.control.spacing_m
        self._cone = cone_of(setup.vehicle)

    def decide(self, senses: Senses) -> Intent:
        """Return what to do now."""
        pull = self._pull(senses.position, senses.neighbours)
        limits = (self._vehicle.max_speed_mps, self._vehicle.max_climb_mps)
        wanted = saturated(pull, *limits)
        velocity, yaw = steer(wanted, senses.yaw, self._cone)
        x, y, z = senses.position
        ahead = (x + wanted[0], y + wanted[1], z + wanted[2])
        return Intent(wanted, velocity, yaw % (2.0 * pi), hypot(*pull), ahead)

    def _pull(self, q: Vector, neighbours: tuple[Heard, ...]) -> Vector:
        """Return the sum of the three rules [m/s]; nothing to do for one that is alone."""
        if not neighbours:
            return (0.0, 0.0, 0.0)
        pull = [0.0, 0.0, 0.0]
        for other in neighbours:
            away = (
                q[0] - other.position[0],
                q[1] - other.position[1],
                q[2] - other.position[2],
            )
            r = max(hypot(*away), 1e-6)
            push = APART * max(0.0, self._spacing / r - 1.0) / r
            for axis in range(3):
                pull[axis] += (
                    push * away[axis] - TOGETHER * away[axis] + ALIKE * other.velocity[axis]
                )
        scale = 1.0 / len(neighbours)
        return (pull[0] * scale, pull[1] * scale, pull[2] * scale)
