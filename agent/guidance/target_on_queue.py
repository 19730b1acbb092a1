"""Algorithm 1: which slot of which queue is mine, from whom I hear and what they claim.

The paper orders the agents of a queue by distance, literally each time anew. Here a place once
claimed is kept (E17): the assignment of :mod:`agent.comms.allocation` gives it up only for a gain
beyond noise. A vertex shared by queues has one agent (E16); slots stand by arc length (E13).
"""

from collections.abc import Sequence

from agent.comms.allocation import allot
from agent.controller import Peer
from agent.messages import Place
from agent.qstructure.formation import Formation, Slot
from agent.qstructure.frame import Frame


class TargetOnQueue:
    """Chooses an agent's place, and says where that place is."""

    def __init__(self, own_id: int, formation: Formation) -> None:
        self._own_id = own_id
        self._formation = formation

    def choose(self, team: Sequence[Peer], frame: Frame) -> tuple[Place, Slot] | None:
        """Return the own place and its slot [m, rad; target's frame].

        team: all members known, oneself included, sorted by id. None where all queues are full.
        """
        layout = self._formation.layout(len(team))
        points = [frame.to_world(layout.slots[place].point) for place in layout.places]
        place = allot(team, layout.places, points)[self._own_id]
        return None if place is None else (place, layout.slots[place])
