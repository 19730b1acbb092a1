"""Places that unidentified vehicles take from a team, as one agent of it finds them (E18).

An unidentified vehicle may be a dead one that hovers, or a vehicle of a team beyond a partition.
Then both teams take each other's vehicles for unidentified, and each makes way for the other. Two
rules end that: an agent that stands in its place keeps it, whatever vehicle comes near; and a place
that a vehicle has left is not available again at once.

The vehicles hover in the world, whatever the team forms: in a new mission or frame the places at
which they hover are found anew, before anybody reports them.
"""

from collections.abc import Sequence
from typing import Final

from agent.comms.unidentified_vehicles import SAME_MEMBER_M
from agent.controller import Flown, Senses
from agent.messages import MAX_PLACES, Place, Vector
from agent.places.place_points import PlacePoints
from agent.qstructure.formation import NO_PLACES
from agent.vectors import apart

HELD_M: Final = 0.2
"""An agent nearer than this to the place that it claims stands in it."""
IDENTIFIED_M: Final = 0.1
"""A member nearer than this to a place is the vehicle that somebody saw there."""
FREED_S: Final = 1.0
"""How long a place that a vehicle has left stays unavailable."""
STALE_S: Final = 1.0
"""How long others may report a place as taken after a member was found to stand in it."""
GROWN_S: Final = 1.0
"""How long blocked places are not remembered after the team has grown."""

Holder = tuple[Place | None, Vector]
"""A member's claimed place and its position [m; world frame]."""


class OccupiedSlots:
    """One agent's view of occupied places.

    seen: the places that it sees taken itself, and reports to others. senses_vehicles: whether it
    carries a sensor for vehicles.
    """

    def __init__(self, points: PlacePoints, senses_vehicles: bool) -> None:
        self.seen: tuple[Place, ...] = ()
        self._points = points
        self._senses_vehicles = senses_vehicles
        self._recent: dict[Place, float] = {}
        self._identified: dict[Place, float] = {}
        """When a member stood in a place that was taken for blocked [s]."""
        self._agents, self._grown_s = 0, 0.0
        self._mission: Flown | None = None  # of the recent places, with its frame at that time

    @property
    def remembers(self) -> bool:
        """Whether places were taken until just now."""
        return bool(self._recent)

    def update(
        self,
        senses: Senses,
        mission: Flown,
        holders: Sequence[Holder],
        agents: int,
        reported: frozenset[Place],
    ) -> frozenset[Place]:
        """Return the places that are not available, by own sight and by others' reports.

        holders: the known members; they do not matter where no place is reported, or was taken of
        late, and no vehicle is unidentified. agents: size of the team; reported: places that others
        see taken.
        """
        if agents > self._agents:
            self._grown_s = senses.now_s
        self._carry_over(mission, agents)
        self._agents, self._mission = agents, mission
        seen = self._points.taken_by(mission, agents, senses.silent, reported)
        if not (seen or reported or self._recent):
            self.seen = ()
            return NO_PLACES
        reported -= self._identify(senses.now_s, mission, holders, reported.union(self._recent))
        occupied = self._occupied(senses, mission, holders, reported, seen)
        return self._with_recent(senses.now_s, occupied)

    def _carry_over(self, mission: Flown, agents: int) -> None:
        """Find the places of a new mission or frame at those that were taken, as long ago."""
        last = self._mission
        if last is None or (last.key, last.frame_key) == (mission.key, mission.frame_key):
            return
        self._identified = {}
        if not self._recent:
            return
        there = [
            (at_s, point)
            for place, at_s in self._recent.items()
            if (point := self._points.point(last, self._agents, place)) is not None
        ]
        taken = sorted(self._points.taken_by(mission, agents, [point for _, point in there]))
        self._recent = {}
        for at_s, point in sorted(there):  # the latest time holds
            near = self._points.near_vehicles(mission, agents, taken, [point])
            self._recent.update(dict.fromkeys(near, at_s))

    def _occupied(
        self,
        senses: Senses,
        mission: Flown,
        holders: Sequence[Holder],
        reported: frozenset[Place],
        silent: frozenset[Place],
    ) -> frozenset[Place]:
        """Return the places that are occupied now; silent: by unidentified vehicles."""
        agents = self._agents
        held = self.held(mission, holders, agents)
        seen = {*silent}
        if self._senses_vehicles:
            recent = [place for place in self._recent if place not in seen]
            strangers = _vehicles_without_neighbour(senses)
            seen.update(self._points.near_vehicles(mission, agents, recent, strangers))
            here, near = senses.position, senses.vehicles
            reported = self._points.plausible(mission, agents, reported, here, near)
        self.seen = _first_to_fill(seen - held)
        return (reported - held).union(seen - held)

    def held(self, mission: Flown, holders: Sequence[Holder], agents: int) -> set[Place]:
        """Return the places in which the agents that claim them stand. agents: size of the team."""
        held = set()
        for place, position in holders:
            if place is not None:
                point = self._points.point(mission, agents, place)
                if point is not None and apart(point, position) < HELD_M:
                    held.add(place)
        return held

    def _identify(
        self, now_s: float, mission: Flown, holders: Sequence[Holder], places: frozenset[Place]
    ) -> frozenset[Place]:
        """Return which places a member stands in, or stood until just now, whatever it claims.

        After a heal all that were unidentified are heard again. What others still report of them,
        and what the agent remembers, would part the team's knowledge for seconds.
        """
        before = self._identified.items()
        self._identified = {place: at_s for place, at_s in before if now_s - at_s < STALE_S}
        for place in places:
            point = self._points.point(mission, self._agents, place)
            if point is not None and any(apart(point, at) < IDENTIFIED_M for _, at in holders):
                self._identified[place] = now_s
                self._recent.pop(place, None)
        return frozenset(self._identified)

    def _with_recent(self, now_s: float, blocked: frozenset[Place]) -> frozenset[Place]:
        """Return the places that are blocked now or were until just now.

        After the team has grown only those blocked now count: the vehicles that blocked the others
        may be the new members.
        """
        if now_s - self._grown_s < GROWN_S:
            self._recent = {}
            return blocked
        before = self._recent.items()
        self._recent = {place: at_s for place, at_s in before if now_s - at_s < FREED_S}
        self._recent.update(dict.fromkeys(blocked, now_s))
        return frozenset(self._recent)


def _first_to_fill(seen: set[Place]) -> tuple[Place, ...]:
    """Return the places that a beacon has room for: those that a team fills first, sorted.

    A choice that depended on the agent's own position would change as it flies; each place that it
    no longer reports would be free for the others.
    """
    first = sorted(seen, key=lambda place: (place.rank, place.queue))[:MAX_PLACES]
    return tuple(sorted(first))


def _vehicles_without_neighbour(senses: Senses) -> list[Vector]:
    """Return the sensed vehicles at which no neighbour is [m; world frame]."""
    x, y, z = senses.position
    seen = [(x + dx, y + dy, z + dz) for dx, dy, dz in senses.vehicles]
    heard = [other.position for other in senses.neighbours]
    return [
        vehicle
        for vehicle in seen
        if all(apart(vehicle, there) >= SAME_MEMBER_M for there in heard)
    ]
