"""Hovering vehicles outside a team, and the places of a formation that they occupy (E18).

Such a vehicle belongs to a dead agent, or to an agent beyond a partition: the team hears nothing of
it. As in the agents' own rule, only a vehicle that stays put occupies a place; one that flies past
does not.
"""

from collections import deque
from collections.abc import Sequence
from math import dist
from typing import Final

import numpy as np
from numpy.typing import NDArray

from agent.comms.unidentified_vehicles import SAME_VEHICLE_M, UNIDENTIFIED_AFTER_S
from agent.controller import Flown
from agent.messages import Place, Vector
from agent.places.place_points import PlacePoints
from agent.qstructure.formation import NO_PLACES, Layout
from worldsim.judge.phase import Phase
from worldsim.judge.tick import Tick
from worldsim.scenario.tables import CONVERGED_M
from worldsim.truth.vehicle import Floats

UNSURE_M: Final = 0.01
"""Besides noise, an agent may be wrong by so much about where a vehicle is [m]."""


class HoveringVehicles:
    """Finds the layout that hovering vehicles leave to a team. It must see every tick.

    spacing: d_ir [m]; noise_m: by how much agents may err about where a vehicle is.
    """

    def __init__(self, spacing: float, noise_m: float = 0.0) -> None:
        self._targets = PlacePoints(spacing)
        unsure_m = 2.0 * (noise_m + UNSURE_M)  # a vehicle takes what is within half the spacing
        self._surely_taken = PlacePoints(spacing - unsure_m)
        self._maybe_taken = PlacePoints(spacing + unsure_m)
        self._positions: deque[tuple[float, Floats]] = deque()

    def see(self, tick: Tick) -> None:
        """Remember where all vehicles are; ticks come in order."""
        past = self._positions
        past.append((tick.time_s, tick.position))
        while len(past) > 1 and past[1][0] <= tick.time_s - UNIDENTIFIED_AFTER_S:
            past.popleft()

    def hovering(self, tick: Tick) -> NDArray[np.bool_]:
        """Return which vehicles hover (N,): within 0.2 m of where they were 1.5 s ago.

        A vehicle that is not in the world does not; at the start of a run none is known to.
        """
        since_s, before = self._positions[0]
        if since_s > tick.time_s - UNIDENTIFIED_AFTER_S:
            return np.zeros(len(before), dtype=np.bool_)
        moved = tick.position - before
        square = moved * moved
        hover: NDArray[np.bool_] = square[:, 0] + square[:, 1] + square[:, 2] < SAME_VEHICLE_M**2
        return hover

    def layout(self, tick: Tick, phase: Phase, team: list[int]) -> Layout:
        """Return how a team (rows) fills the phase's formation around hovering vehicles."""
        return phase.formation.layout(len(team), self.occupied_places(tick, phase, team))

    def occupied_places(
        self, tick: Tick, phase: Phase, team: list[int], seen: NDArray[np.bool_] | None = None
    ) -> frozenset[Place]:
        """Return the places that a team (rows) cannot have: other vehicles hover there.

        seen: which vehicles count (N,); None: all.
        """
        positions = self._others(tick, team, seen)
        return self.places_near(tick, phase, team, positions) if positions else NO_PLACES

    def _others(
        self, tick: Tick, team: list[int], seen: NDArray[np.bool_] | None = None
    ) -> list[Vector]:
        """Return where vehicles outside a team (rows) hover [m; world frame]. seen: which count."""
        if len(team) == len(tick.alive):
            return []
        others = self.hovering(tick)
        others[team] = False
        if seen is not None:
            others &= seen
        return [(x, y, z) for x, y, z in tick.position[others].tolist()]

    def places_near(
        self,
        tick: Tick,
        phase: Phase,
        team: list[int],
        positions: Sequence[Vector],
        occupied: frozenset[Place] = NO_PLACES,
    ) -> frozenset[Place]:
        """Return the places that vehicles at positions [m; world frame] would take from a team.

        occupied: places that others take.
        """
        return self._targets.taken_by(_flown(tick, phase), len(team), positions, occupied)

    def is_doubtful(self, tick: Tick, phase: Phase, team: list[int]) -> bool:
        """Whether a team (rows) may or may not take a place for taken."""
        surely, maybe = self._bounds(tick, phase, team)
        return surely != maybe

    def places_left_out(self, tick: Tick, phase: Phase, team: list[int]) -> frozenset[Place]:
        """Return the places that others take from a team (rows), in doubt as its agents see it.

        An agent that stands in its place keeps it, whatever hovers beside it.
        """
        surely, maybe = self._bounds(tick, phase, team)
        if maybe:
            held = self.held_places(tick, phase, team)
            surely, maybe = surely - held, maybe - held
        if surely == maybe:
            return surely
        claims = phase.claims(tick)
        claimed = {Place(*claims[row]) for row in team}
        return surely | (maybe - claimed)

    def _bounds(
        self, tick: Tick, phase: Phase, team: list[int]
    ) -> tuple[frozenset[Place], frozenset[Place]]:
        """Return the places that others surely take from a team, and those that they may take."""
        positions = self._others(tick, team)
        if not positions:
            return NO_PLACES, NO_PLACES
        flown, agents = _flown(tick, phase), len(team)
        return (
            self._surely_taken.taken_by(flown, agents, positions),
            self._maybe_taken.taken_by(flown, agents, positions),
        )

    def held_places(self, tick: Tick, phase: Phase, team: list[int]) -> frozenset[Place]:
        """Return the places in which agents of a team (rows) stand that claim them."""
        mission, claims = _flown(tick, phase), phase.claims(tick)
        held = set()
        for row in team:
            place = Place(*claims[row])
            point = self._targets.point(mission, len(team), place)
            if point is not None and dist(point, tick.position[row].tolist()) <= CONVERGED_M:
                held.add(place)
        return frozenset(held)


def _flown(tick: Tick, phase: Phase) -> Flown:
    return Flown(phase.mission, phase.formation, phase.frame(tick.time_s))
