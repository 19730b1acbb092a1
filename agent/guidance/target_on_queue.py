"""Algorithm 1: which slot of which queue is mine, from whom I hear and what they claim.

The paper orders the agents of a queue by distance, literally each time anew. Here a place once
claimed is kept (E17): the assignment of :mod:`agent.comms.allocation` gives it up only for a gain
beyond noise. A vertex shared by queues has one agent (E16); slots stand by arc length (E13).
"""

from collections.abc import Sequence

from agent.comms.allocation import own_place
from agent.controller import Peer
from agent.messages import Place, Vector
from agent.qstructure.formation import Formation, Layout, Slot
from agent.qstructure.frame import Frame


class TargetOnQueue:
    """Chooses an agent's place, and says where that place is."""

    def __init__(self, own_id: int, formation: Formation) -> None:
        self._own_id = own_id
        self._formation = formation
        self._seen: tuple[Layout, Frame, list[Vector]] | None = None

    def choose(self, team: Sequence[Peer], frame: Frame) -> tuple[Place, Slot] | None:
        """Return the own place and its slot [m, rad; target's frame].

        team: all members known, oneself included, sorted by id. None where all queues are full.
        """
        layout = self._formation.layout(len(team))
        place = own_place(self._own_id, team, layout.places, self._points(layout, frame))
        return None if place is None else (place, layout.slots[place])

    def _points(self, layout: Layout, frame: Frame) -> list[Vector]:
        """Return where a layout's places are [m; world frame]; remembered while both stay."""
        if self._seen is None or self._seen[0] is not layout or self._seen[1] is not frame:
            points = [frame.to_world(layout.slots[place].point) for place in layout.places]
            self._seen = (layout, frame, points)
        return self._seen[2]
