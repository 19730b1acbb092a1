"""Target-on-queue: the own slot, from the known team and its claims (Algorithm 1).

The paper orders the agents of a queue by distance, anew each time. Here a claimed place is kept
(E17): the assignment of :mod:`agent.assignment.allocation` gives it up only for a gain beyond
noise.
"""

from collections.abc import Sequence

from agent.assignment.allocation import own_place
from agent.controller import Flown, Peer
from agent.messages import Place
from agent.places.place_points import OwnTarget, PlacePoints


class TargetOnQueue:
    """Chooses an agent's place in a formation, whose points are ``points``."""

    def __init__(self, own_id: int, points: PlacePoints) -> None:
        self._own_id = own_id
        self.points = points

    def choose(
        self, mission: Flown, team: Sequence[Peer], blocked: frozenset[Place]
    ) -> OwnTarget | None:
        """Return the own target; None if all queues are full.

        team: all known members, the own agent included, sorted by id; blocked: the places that are
        not available.
        """
        layout = mission.formation.layout(len(team), blocked)
        points = self.points.of_layout(layout, mission.frame)
        place = own_place(self._own_id, team, layout.places, points)
        if place is None:
            return None
        return OwnTarget(place=place, slot=layout.slots[place], vertex=place in layout.heads)
