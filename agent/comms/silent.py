"""Silent bodies: vehicles that are sensed and stay put, but from which nothing is heard (E18).

A dead agent's vehicle may hover in a slot. Whoever senses it long enough without knowing of anybody
there takes it for what it is, and remembers it while out of the sensor's range. A sensor may see
farther than a radio hears: a body is silent only if others as far away are heard.
"""

from collections.abc import Sequence
from math import dist

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
        heard: Sequence[Vector],
        told: Sequence[Vector],
    ) -> tuple[Vector, ...]:
        """Return where silent bodies stand [m; world frame].

        sensed: bodies relative to ``position`` [m; world axes]; heard, told: where members of the
        team are, by their own words and by what others pass on [m; world frame].
        """
        reach = max((dist(position, other) for other in heard), default=0.0)
        unknown = [
            body
            for body in _in_world(position, sensed)
            if dist(position, body) <= reach + SAME_BODY_M
            and all(dist(body, other) >= NEIGHBOUR_M for other in (*heard, *told))
        ]
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


def _in_world(position: Vector, sensed: Sequence[Vector]) -> list[Vector]:
    return [(position[0] + x, position[1] + y, position[2] + z) for x, y, z in sensed]
