"""Algorithm 1: which slot of which queue is mine, from whom I hear and what they claim.

The paper orders the agents of a queue by distance, literally each time anew. Here a place once
claimed is kept (E17): the assignment of :mod:`agent.comms.allocation` gives it up only for a gain
beyond noise. A vertex shared by queues has one agent (E16); slots stand by arc length (E13).
"""

from collections.abc import Iterable, Sequence
from math import dist, hypot
from typing import NamedTuple

from agent.comms.allocation import own_place
from agent.comms.unidentified_vehicles import SURE_RANGE_M
from agent.controller import Flown, Peer
from agent.messages import MAX_PLACES, Place, Vector
from agent.qstructure.formation import Layout, Slot
from agent.qstructure.target_frame import Frame


class OwnTarget(NamedTuple):
    """An agent's place, where it is, and what comes with it.

    slot [m, rad; target's frame]; vertex: whether the holder is a queue-vertex agent.
    """

    place: Place
    slot: Slot
    vertex: bool


class TargetOnQueue:
    """Chooses an agent's place in a formation. spacing: d_ir [m]."""

    def __init__(self, own_id: int, spacing: float) -> None:
        self._own_id = own_id
        self._blocking_m = 0.5 * spacing
        self._seen: tuple[Layout, Frame, list[Vector]] | None = None

    def choose(
        self, mission: Flown, team: Sequence[Peer], blocked: frozenset[Place]
    ) -> OwnTarget | None:
        """Return the own target; None where all queues are full.

        team: all members known, oneself included, sorted by id; blocked: places that cannot be had.
        """
        layout = mission.formation.layout(len(team), blocked)
        points = self._points(layout, mission.frame)
        place = own_place(self._own_id, team, layout.places, points)
        if place is None:
            return None
        return OwnTarget(place, layout.slots[place], place in layout.heads)

    def blocked(self, mission: Flown, agents: int, silent: Sequence[Vector]) -> tuple[Place, ...]:
        """Return the places of a team that are within d_ir / 2 of a silent body (E18)."""
        found: set[Place] = set()
        while silent and len(found) < MAX_PLACES:
            layout = mission.formation.layout(agents, frozenset(found))
            points = self._points(layout, mission.frame)
            new = {
                place
                for place, point in zip(layout.places, points, strict=True)
                if any(dist(point, body) <= self._blocking_m for body in silent)
            }
            if not new:
                break
            found |= new
        return tuple(sorted(found))[:MAX_PLACES]

    def beside(
        self, mission: Flown, agents: int, places: Iterable[Place], bodies: Sequence[Vector]
    ) -> list[Place]:
        """Return which of some places are within d_ir / 2 of a body [m; world frame]."""
        points = [(place, self.point(mission, agents, place)) for place in places]
        return [
            place
            for place, point in points
            if point is not None and any(dist(point, body) <= self._blocking_m for body in bodies)
        ]

    def point(self, mission: Flown, agents: int, place: Place) -> Vector | None:
        """Return where a place is [m; world frame] in a team of that size; None for no place."""
        slot = mission.formation.slot(place, agents)
        return mission.frame.to_world(slot.point) if slot is not None else None

    def believed(
        self,
        mission: Flown,
        agents: int,
        told: frozenset[Place],
        here: Vector,
        near: Sequence[Vector],
    ) -> frozenset[Place]:
        """Return which places that others tell of as blocked may be so, by what one sees oneself.

        here [m; world frame]: where one is; near: the bodies sensed from there, relative to it [m].
        """
        return frozenset(
            place for place in told if not self._is_empty(mission, agents, place, here, near)
        )

    def _is_empty(
        self, mission: Flown, agents: int, place: Place, here: Vector, near: Sequence[Vector]
    ) -> bool:
        point = self.point(mission, agents, place)
        if point is None:
            return False
        x, y, z = point
        away = (x - here[0], y - here[1], z - here[2])
        in_sight = hypot(*away) <= SURE_RANGE_M - self._blocking_m
        return in_sight and all(dist(away, body) > self._blocking_m for body in near)

    def _points(self, layout: Layout, frame: Frame) -> list[Vector]:
        """Return where a layout's places are [m; world frame]; remembered while both stay."""
        if self._seen is None or self._seen[0] is not layout or self._seen[1] is not frame:
            points = [frame.to_world(layout.slots[place].point) for place in layout.places]
            self._seen = (layout, frame, points)
        return self._seen[2]
