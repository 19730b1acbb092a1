"""Which scheme allocates the places: the Q-structure, or for comparison the assignment."""

from typing import Protocol, assert_never

from agent.assignment.slot_selection import SlotSelection
from agent.config import AgentSetup
from agent.controller import Senses, Words
from agent.messages import Place
from agent.places.place_points import OwnTarget
from agent.structure.member import StructureMember


class PlaceSelection(Protocol):
    """One agent's choice of its place, under either scheme."""

    @property
    def cost_m(self) -> float:
        """Distance to the place when it was first claimed [m]."""

    @property
    def blocked(self) -> tuple[Place, ...]:
        """The places that the agent sees taken by an unidentified vehicle (E18)."""

    def select(self, senses: Senses) -> OwnTarget | None:
        """Return the own target now; None for an agent without one."""

    def words(self, now_s: float) -> Words:
        """Return what the agent says of its part; call it once a tick, after ``select``."""


def place_selection(setup: AgentSetup) -> PlaceSelection:
    """Return the scheme of ``[control] allocation``."""
    match setup.control.allocation:
        case "structure":
            return StructureMember(setup)
        case "assignment":
            return SlotSelection(setup)
    assert_never(setup.control.allocation)
