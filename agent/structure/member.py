"""A member of the Q-structure: the structure of the mission that it flies.

With each mission the structure begins anew, but for the places: they follow from those before, and
those that unidentified vehicles take are found at the same points.
"""

from agent.config import AgentSetup
from agent.controller import Flown, Senses, Words
from agent.messages import DISTRESS, Place
from agent.places.occupied_slots import OccupiedSlots
from agent.places.place_points import OwnTarget, PlacePoints
from agent.structure.relocation import relocated
from agent.structure.structure import Structure


class StructureMember:
    """One agent's place, by the Q-structure.

    structure: another kind of structure may be flown, to see what a part of it is worth.
    """

    def __init__(self, setup: AgentSetup, structure: type[Structure] = Structure) -> None:
        self._setup, self._kind = setup, structure
        self._structure: Structure | None = None
        self._mission = -1
        points = PlacePoints(setup.control.spacing_m)
        self._words = Words()
        """Said last; made anew only where something changed, for it is a named tuple."""
        self._occupied = OccupiedSlots(points, "proximity" in setup.vehicle.sensors)

    @property
    def cost_m(self) -> float:
        """Distance to the place when it was first claimed [m]."""
        return self._structure.claim.cost_m if self._structure is not None else 0.0

    @property
    def blocked(self) -> tuple[Place, ...]:
        """The places that the agent sees taken by an unidentified vehicle (E18)."""
        return self._occupied.seen

    def select(self, senses: Senses) -> OwnTarget | None:
        """Return the own target now; None for an agent without one."""
        mission = senses.mission
        if mission is None:
            return None
        if self._structure is None or mission.key != self._mission:
            self._mission = mission.key
            self._structure = self._begun(mission, senses.now_s)
        return self._structure.update(senses, mission)

    def _begun(self, mission: Flown, now_s: float) -> Structure:
        """Return the structure of a mission; its team stands in places of the one before."""
        held = self._structure.held if self._structure is not None else None
        spacing_m = self._setup.control.spacing_m
        before = relocated(held, mission, now_s, spacing_m) if held is not None else None
        return self._kind(self._setup, mission, now_s, self._occupied, before)

    def words(self, now_s: float) -> Words:
        """Return what the agent says of its part; call it once a tick, after ``select``."""
        own = self._structure
        if own is None:
            return Words(role=DISTRESS)
        standing, summary, said = own.standing(now_s), own.summary(now_s), self._words
        tier, parent, role, agents = own.tier, own.parent, own.role, own.agents
        spoken = standing is said.standing and summary is None and said.summary is None
        if spoken and (tier, parent, role, agents) == said[2:]:
            return said
        self._words = Words(standing, summary, tier, parent, role, agents)
        return self._words
