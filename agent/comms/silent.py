"""Silent bodies: vehicles that are sensed and stay put, but from which nothing is heard (E18).

A dead agent's vehicle may hover in a slot. Whoever senses it long enough without hearing anybody
there takes it for what it is, and remembers it while out of the sensor's range.
"""

from collections.abc import Sequence
from math import dist

from agent.controller import Heard
from agent.messages import Vector

SAME_BODY_M = 0.2
NEIGHBOUR_M = 0.4
SILENCE_S = 1.5
SURE_RANGE_M = 1.8
"""Nearer than this a body would be sensed if it were still there."""


class SilentBodies:
    """The silent bodies that one agent knows of."""

    def __init__(self) -> None:
        self._since: list[tuple[Vector, float]] = []

    def look(
        self,
        now_s: float,
        position: Vector,
        sensed: Sequence[Vector],
        neighbours: Sequence[Heard],
    ) -> tuple[Vector, ...]:
        """Return where silent bodies stand [m; world frame].

        sensed: bodies relative to ``position`` [m; world axes].
        """
        unknown = self._unexplained(position, sensed, neighbours)
        kept = [
            (body, since_s)
            for body, since_s in self._since
            if any(dist(body, seen) < SAME_BODY_M for seen in unknown)
            or dist(body, position) > SURE_RANGE_M
        ]
        new = [
            (seen, now_s)
            for seen in unknown
            if all(dist(body, seen) >= SAME_BODY_M for body, _ in kept)
        ]
        self._since = kept + new
        return tuple(body for body, since_s in self._since if now_s - since_s >= SILENCE_S)

    @staticmethod
    def _unexplained(
        position: Vector, sensed: Sequence[Vector], neighbours: Sequence[Heard]
    ) -> list[Vector]:
        seen = [(position[0] + x, position[1] + y, position[2] + z) for x, y, z in sensed]
        return [
            body
            for body in seen
            if all(dist(body, other.position) >= NEIGHBOUR_M for other in neighbours)
        ]
