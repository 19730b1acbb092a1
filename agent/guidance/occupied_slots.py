"""Which places bodies take from a team, as one agent of it finds (E18).

A body may be a dead vehicle that hovers, or one of a team beyond a partition: then both teams take
each other's vehicles for bodies, and each makes way for the other. Two rules end that. Who stands
in a place has it, whoever comes near; and a place that a body has left is not had again at once.
"""

from collections.abc import Sequence
from math import dist

from agent.comms.unidentified_vehicles import NEIGHBOUR_M
from agent.controller import Peer, Senses
from agent.guidance.target_on_queue import TargetOnQueue
from agent.messages import MAX_PLACES, Place, Vector
from agent.qstructure.formation import NO_PLACES

HELD_M = 0.2
"""Who claims a place and is nearer to it than this stands in it."""
FREED_S = 1.0
GROWN_S = 1.0
"""So long what a team takes for blocked may lag behind what it knows of new members."""


class Blocked:
    """One agent's view. seen: the places that it sees taken itself, and tells others of.

    sees: whether it can sense bodies at all.
    """

    def __init__(self, targets: TargetOnQueue, sees: bool) -> None:
        self.seen: tuple[Place, ...] = ()
        self._targets = targets
        self._sees = sees
        self._lately: dict[Place, float] = {}
        self._agents, self._grown_s = 0, 0.0

    def now(self, senses: Senses, team: Sequence[Peer]) -> frozenset[Place]:
        """Return the places that cannot be had: by what one sees, and by what one is told."""
        if len(team) > self._agents:
            self._grown_s = senses.now_s
        self._agents = len(team)
        self.seen = self._targets.blocked(senses.mission, len(team), senses.silent)
        if not (self.seen or senses.blocked or self._lately):
            return NO_PLACES
        return self._lasting(senses.now_s, self._found(senses, team))

    def _found(self, senses: Senses, team: Sequence[Peer]) -> frozenset[Place]:
        mission, agents, told = senses.mission, len(team), senses.blocked
        held = self._held(senses, team)
        seen = {*self.seen}
        if self._sees:
            lately = [place for place in self._lately if place not in seen]
            seen.update(self._targets.beside(mission, agents, lately, _strangers(senses)))
            here, near = senses.position, senses.vehicles
            told = self._targets.believed(mission, agents, told, here, near)
        self.seen = tuple(sorted(seen - held))[:MAX_PLACES]
        return (told - held).union(self.seen)

    def _held(self, senses: Senses, team: Sequence[Peer]) -> set[Place]:
        """Return the places in which their holders stand."""
        held = set()
        for peer in team:
            if peer.place is not None:
                point = self._targets.point(senses.mission, len(team), peer.place)
                if point is not None and dist(point, peer.position) < HELD_M:
                    held.add(peer.place)
        return held

    def _lasting(self, now_s: float, blocked: frozenset[Place]) -> frozenset[Place]:
        """Return the places that are blocked, or were until just now.

        The latter not where new members are known: theirs may have been the bodies.
        """
        if now_s - self._grown_s < GROWN_S:
            self._lately = {}
            return blocked
        was = self._lately.items()
        self._lately = {place: at_s for place, at_s in was if now_s - at_s < FREED_S}
        self._lately.update(dict.fromkeys(blocked, now_s))
        return frozenset(self._lately)


def _strangers(senses: Senses) -> list[Vector]:
    """Return the bodies in sight where no neighbour is [m; world frame]."""
    x, y, z = senses.position
    seen = [(x + dx, y + dy, z + dz) for dx, dy, dz in senses.vehicles]
    heard = [other.position for other in senses.neighbours]
    return [body for body in seen if all(dist(body, there) >= NEIGHBOUR_M for there in heard)]
