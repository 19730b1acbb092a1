"""Vehicles of no member: which places of a formation they take from a team (E18).

They hover dead, or belong to those beyond a partition; a team hears nothing of either.
"""

import numpy as np

from agent.controller import Flown
from agent.guidance.target_on_queue import TargetOnQueue
from agent.messages import Place
from agent.qstructure.formation import Layout
from worldsim.judge.phase import Phase
from worldsim.judge.tick import Tick


class Bodies:
    """Finds the layout that is left to the living; spacing: d_ir [m]."""

    def __init__(self, spacing: float) -> None:
        self._targets = TargetOnQueue(-1, spacing)

    def layout(self, tick: Tick, phase: Phase, team: list[int]) -> Layout:
        """Return how these rows fill the phase's formation, round all other vehicles."""
        return phase.formation.layout(len(team), self.blocked(tick, phase, team))

    def blocked(self, tick: Tick, phase: Phase, team: list[int]) -> frozenset[Place]:
        """Return the places that these rows cannot have."""
        others = ~np.isnan(tick.position[:, 0])
        others[team] = False
        bodies = [(x, y, z) for x, y, z in tick.position[others].tolist()]
        flown = Flown(phase.mission, phase.formation, phase.frame(tick.time_s))
        return frozenset(self._targets.blocked(flown, len(team), bodies))
