"""Vehicles of no member: which places of a formation they take from a team (E18).

They hover dead, or belong to those beyond a partition; a team hears nothing of either. Who only
flies past a place takes it from nobody: as for the agents, a body is what stays put.
"""

from collections import deque

import numpy as np
from numpy.typing import NDArray

from agent.comms.unidentified_vehicles import SAME_VEHICLE_M, UNIDENTIFIED_AFTER_S
from agent.controller import Flown
from agent.guidance.target_on_queue import TargetOnQueue
from agent.messages import Place
from agent.qstructure.formation import Layout
from worldsim.judge.phase import Phase
from worldsim.judge.tick import Singles, Tick


class HoveringVehicles:
    """Finds the layout that is left to the living; spacing: d_ir [m]. Sees every tick."""

    def __init__(self, spacing: float) -> None:
        self._targets = TargetOnQueue(-1, spacing)
        self._past: deque[tuple[float, Singles]] = deque()

    def see(self, tick: Tick) -> None:
        """Remember where everybody is; ticks come in order."""
        past = self._past
        past.append((tick.time_s, tick.position))
        while len(past) > 1 and past[1][0] <= tick.time_s - UNIDENTIFIED_AFTER_S:
            past.popleft()

    def standing(self, tick: Tick) -> NDArray[np.bool_]:
        """Return who stands (N,): in the world, and within 0.2 m of where it was 1.5 s ago."""
        since_s, before = self._past[0]
        if since_s > tick.time_s - UNIDENTIFIED_AFTER_S:
            return np.zeros(len(before), dtype=np.bool_)
        off = tick.position - before
        square = off * off
        stands: NDArray[np.bool_] = square[:, 0] + square[:, 1] + square[:, 2] < SAME_VEHICLE_M**2
        return stands

    def layout(self, tick: Tick, phase: Phase, team: list[int]) -> Layout:
        """Return how these rows fill the phase's formation, round all other vehicles."""
        return phase.formation.layout(len(team), self.blocked(tick, phase, team))

    def blocked(self, tick: Tick, phase: Phase, team: list[int]) -> frozenset[Place]:
        """Return the places that these rows cannot have."""
        others = self.standing(tick)
        others[team] = False
        bodies = [(x, y, z) for x, y, z in tick.position[others].tolist()]
        flown = Flown(phase.mission, phase.formation, phase.frame(tick.time_s))
        return frozenset(self._targets.taken_by(flown, len(team), bodies))
