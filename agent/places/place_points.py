"""Where the places of a formation are in the world, and which of them a vehicle stands in.

A vertex shared by queues is one place (E16); slots stand by arc length (E13).
"""

from collections.abc import Iterable, Sequence
from math import dist, hypot
from typing import final

from agent.comms.unidentified_vehicles import SURE_RANGE_M
from agent.controller import Flown
from agent.messages import Place, Vector
from agent.qstructure.formation import NO_PLACES, Layout, Slot
from agent.qstructure.target_frame import Frame


@final
class OwnTarget:
    """An agent's place and its slot."""

    def __init__(
        self,
        place: Place | None,  # None where the agent waits by a slot without claiming it
        slot: Slot,  # [m, rad; target's frame]
        vertex: bool,  # whether its holder is a queue-vertex agent
    ) -> None:
        self.place = place
        self.slot = slot
        self.vertex = vertex


class PlacePoints:
    """The positions of a mission's places. spacing: d_ir [m]."""

    def __init__(self, spacing: float) -> None:
        self._blocks_within_m = 0.5 * spacing
        self._cached: tuple[Layout, Frame, list[Vector]] | None = None

    def taken_by(
        self,
        mission: Flown,
        agents: int,
        vehicles: Sequence[Vector],
        reported: frozenset[Place] = NO_PLACES,
    ) -> frozenset[Place]:
        """Return the places of a team that are within d_ir / 2 of an unidentified vehicle (E18).

        vehicles [m; world frame]. reported: places that others see taken; the team fills the places
        beyond them, so these are examined too.
        """
        if not vehicles:
            return NO_PLACES
        found = {*self.near_vehicles(mission, agents, reported, vehicles)}
        while True:
            layout = mission.formation.layout(agents, reported.union(found))
            points = self.of_layout(layout, mission.frame)
            new = {
                place
                for place, point in zip(layout.places, points, strict=True)
                if any(dist(point, vehicle) <= self._blocks_within_m for vehicle in vehicles)
            }
            if not new:
                return frozenset(found)
            found |= new

    def near_vehicles(
        self, mission: Flown, agents: int, places: Iterable[Place], vehicles: Sequence[Vector]
    ) -> list[Place]:
        """Return which of some places are within d_ir / 2 of a vehicle [m; world frame]."""
        points = [(place, self.point(mission, agents, place)) for place in places]
        return [
            place
            for place, point in points
            if point is not None
            and any(dist(point, vehicle) <= self._blocks_within_m for vehicle in vehicles)
        ]

    def point(self, mission: Flown, agents: int, place: Place) -> Vector | None:
        """Return a place's position in a team of that size [m; world frame]; None if not there."""
        slot = mission.formation.slot(place, agents)
        return mission.frame.to_world(slot.point) if slot is not None else None

    def plausible(
        self,
        mission: Flown,
        agents: int,
        reported: frozenset[Place],
        here: Vector,
        near: Sequence[Vector],
    ) -> frozenset[Place]:
        """Return the places reported as blocked, without those that the agent sees empty itself.

        here: own position [m; world frame]; near: sensed vehicles relative to it [m; world axes].
        """
        return frozenset(
            place for place in reported if not self._is_empty(mission, agents, place, here, near)
        )

    def _is_empty(
        self, mission: Flown, agents: int, place: Place, here: Vector, near: Sequence[Vector]
    ) -> bool:
        point = self.point(mission, agents, place)
        if point is None:
            return False
        x, y, z = point
        away = (x - here[0], y - here[1], z - here[2])
        in_sight = hypot(*away) <= SURE_RANGE_M - self._blocks_within_m
        return in_sight and all(dist(away, vehicle) > self._blocks_within_m for vehicle in near)

    def of_layout(self, layout: Layout, frame: Frame) -> list[Vector]:
        """Return the positions of a layout's places [m; world frame], kept while both stay."""
        if self._cached is None or self._cached[0] is not layout or self._cached[1] is not frame:
            points = [frame.to_world(layout.slots[place].point) for place in layout.places]
            self._cached = (layout, frame, points)
        return self._cached[2]
