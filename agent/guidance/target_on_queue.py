"""Algorithm 1: which slot of which queue is mine, from whom I hear and what they claim.

The paper orders the agents of a queue by distance, literally each time anew. Here a place once
claimed is kept (E17): the assignment of :mod:`agent.comms.allocation` gives it up only for a gain
beyond noise. A vertex shared by queues has one agent (E16); slots stand by arc length (E13).
"""

from collections.abc import Sequence

from agent.comms.allocation import allot
from agent.controller import Peer
from agent.messages import Place, Vector
from agent.qstructure.formation import Formation
from agent.qstructure.frame import Frame


class TargetOnQueue:
    """Chooses an agent's place, and says where that place is.

    spacing: d_ir [m].
    """

    def __init__(self, own_id: int, formation: Formation, spacing: float) -> None:
        self._own_id = own_id
        self._formation = formation
        self._spacing = spacing
        self._slots: dict[Place, Vector] = {}

    def choose(self, team: Sequence[Peer], frame: Frame) -> Place:
        """Return the own place, given all members known, oneself included, sorted by id."""
        places = self._formation.places(len(team))
        slots = [self.slot(place, frame) for place in places]
        return allot(team, places, slots)[self._own_id]

    def slot(self, place: Place, frame: Frame) -> Vector:
        """Return the target-on-queue of a place [m; world frame]: s_i = s_k + d_ir (E13)."""
        on_queue = self._slots.get(place)
        if on_queue is None:
            on_queue = self._slots[place] = self._formation.slot(place, self._spacing)
        return frame.to_world(on_queue)
