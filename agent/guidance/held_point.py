"""Where an agent without a mission stays: beside the team, at rest in the frame that it hears of.

It knows no formation and so has no place. It holds the point of the frame at which it first heard
of the frame, so that a team that moves on does not leave it behind before the mission arrives. It
insists on no point: where another agent needs the room, it holds the point to which it gave way.
"""

from math import dist
from typing import Final

from agent.controller import Senses
from agent.messages import Vector
from agent.qstructure.mission_check import can_hold
from agent.qstructure.target_frame import Frame

AT_REST = Frame()
JUMP_M: Final = 1.0
"""A point that jumps by more within one step, in the frame of the same mission, shows that two
senders contradict each other. Then the agent holds the point where it is."""


class HeldPoint:
    """The point of a heard frame that one agent holds."""

    def __init__(self) -> None:
        self._point: Vector | None = None
        """[m; heard frame]"""
        self._key = 0
        self._before: Vector | None = None
        """The point one step ago [m; world frame]."""

    def target(self, senses: Senses) -> tuple[Vector, Frame]:
        """Return where to stay [m; world frame], and the frame in which that point rests.

        An agent that hears of no frame stays at its own position, at rest in the world. So does one
        that is farther from the frame's origin than any slot may be (``can_hold``).
        """
        heard = senses.heard_frame
        if heard is None:
            return self._hover(senses)
        frame = heard.frame
        held = self._point
        if held is None or self._is_contradicted(heard.key, frame.to_world(held)):
            held = frame.to_frame(senses.position)
        if not can_hold(frame, held):
            return self._hover(senses)
        self._key, self._point, self._before = heard.key, held, frame.to_world(held)
        return self._before, frame

    def give_way(self) -> None:
        """Hold the point where the agent is at the next step: others need this one."""
        self._point = None

    def _hover(self, senses: Senses) -> tuple[Vector, Frame]:
        self._point = None
        return senses.position, AT_REST

    def _is_contradicted(self, key: int, now: Vector) -> bool:
        if key != self._key:
            return key < self._key
        return self._before is not None and dist(self._before, now) > JUMP_M
