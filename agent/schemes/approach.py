"""What the schemes share below their targets: the vehicle's limits, turns, and ways past others.

So schemes differ in what an agent has to know of which others, not in how it flies its vehicle.
"""

from math import hypot
from typing import Final

from agent.config import AgentSetup
from agent.controller import NO_WORDS, Intent, Senses, Words
from agent.guidance.cone import cone_of
from agent.guidance.deadlock_escape import DeadlockEscape
from agent.guidance.movement import saturated, steer
from agent.messages import ZERO, Place, Vector

GAIN: Final = 2.0
"""Speed towards a target for each metre that it is away [1/s]; the same as c of (28) that flies."""


class Approach:
    """Flies one agent with the velocity that its scheme asks for."""

    def __init__(self, setup: AgentSetup) -> None:
        self._max_speed = setup.vehicle.max_speed_mps
        self._max_climb = setup.vehicle.max_climb_mps
        self._cone = cone_of(setup.vehicle)
        self._escape = DeadlockEscape(setup.id)

    def fly(
        self,
        senses: Senses,
        velocity: Vector,
        target: Vector,
        place: Place | None,
        words: Words = NO_WORDS,
    ) -> Intent:
        """Return the intent of an agent that is on its way to its place.

        velocity: what the scheme asks for [m/s; world frame]; target: where the way ends [m; world
        frame]; place: the one that it claims, if any.
        """
        wanted = saturated(velocity, self._max_speed, self._max_climb)
        escape = self._escape.direction(senses, target)
        if escape is not None:
            v = self._max_speed
            x, y, z = wanted
            wanted = (x + v * escape[0], y + v * escape[1], z + v * escape[2])
            wanted = saturated(wanted, self._max_speed, self._max_climb)
        flown, yaw = steer(wanted, senses.yaw, self._cone)
        return Intent(
            wanted=wanted,
            velocity=flown,
            yaw=yaw,
            force=hypot(*velocity),
            heading_for=target,
            target=target if place is not None else None,
            place=place,
            words=words,
        )

    def hover(self, senses: Senses, words: Words = NO_WORDS) -> Intent:
        """Return the intent of an agent that knows no way to a place."""
        return self.fly(senses, ZERO, senses.position, None, words)


def towards(q: Vector, target: Vector, drift: Vector = ZERO) -> Vector:
    """Return the velocity from q to a target that drifts [m/s]; q, target [m], drift [m/s]."""
    return (
        drift[0] + GAIN * (target[0] - q[0]),
        drift[1] + GAIN * (target[1] - q[1]),
        drift[2] + GAIN * (target[2] - q[2]),
    )
