"""The Q-structure with fixed places: each agent takes the place of its id, and keeps it."""

from agent.config import AgentSetup
from agent.controller import NO_WORDS, Senses, Words
from agent.guidance.q_structure import QStructure
from agent.places.place_points import OwnTarget


class ByNumber:
    """Agent k takes the k-th place of the formation."""

    def __init__(self, own_id: int) -> None:
        self._own_id = own_id
        self.cost_m = 0.0
        self.blocked = ()

    def select(self, senses: Senses) -> OwnTarget | None:
        """Return the target of this agent in a team of two; None without a mission."""
        if senses.mission is None:
            return None
        layout = senses.mission.formation.layout(2)
        place = layout.places[self._own_id]
        return OwnTarget(place, layout.slots[place], vertex=True)

    def words(self, _now_s: float) -> Words:
        """Say nothing of a structure: there is none."""
        return NO_WORDS


class Swapping(QStructure):
    """Flies to the place of its id."""

    def __init__(self, setup: AgentSetup) -> None:
        super().__init__(setup)
        self._places = ByNumber(setup.id)  # type: ignore[assignment]
