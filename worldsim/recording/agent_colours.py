"""Colours of agents over time: of their queues in a formation, of their own where there is none.

A colour keeps its meaning: an agent has the colour of its queue from the moment that it claims a
place in it, and a controller that forms nothing leaves each agent a colour of its own. Distress and
a stopped process show in the vehicle, not in the agent's curves.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from agent.messages import DISTRESS
from agent.qstructure.formation import Formation
from worldsim.judge.tick import Tick
from worldsim.recording import palette

FIRST_MISSION = 0


class AgentColours:
    """Colours of one block of ticks after the other.

    formation: of the start. forms: whether the controller is known to take up formations; of any
    other it is seen when an agent claims a place.
    """

    def __init__(self, agents: int, formation: Formation, forms: bool) -> None:
        self._own = palette.agent_colours(agents)
        self._forms = forms
        self._shared = {FIRST_MISSION: _shared_places(formation)}
        self._series = np.full(agents, palette.UNPLACED) if forms else self._own.copy()

    def begin_phase(self, formation: Formation, mission: int) -> None:
        """Take the formation of a new mission, given by its key, before the block of its ticks."""
        self._shared[mission] = _shared_places(formation)

    @property
    def forms(self) -> bool:
        """Whether agents have the colours of queues."""
        return self._forms

    def vehicles(self, ticks: Sequence[Tick], dead: Sequence[NDArray[np.bool_]]) -> palette.Colours:
        """Return the colours of agents' vehicles (T, N); blocks come in order.

        dead: for each tick, whose processes have ended (N,).
        """
        colours = np.stack([self._vehicles(tick) for tick in ticks])
        colours[np.stack(dead)] = palette.DEAD
        return colours.astype(np.uint32)

    def series(self) -> palette.Colours:
        """Return the colours of agents' curves (N,), as of the last tick."""
        return self._series.copy()

    def _vehicles(self, tick: Tick) -> palette.Colours:
        placed = tick.place[:, 0] >= 0
        self._forms = self._forms or bool(placed.any())
        if not self._forms:
            return np.where(tick.alive, self._own, palette.NOT_RUNNING)
        colours = self._place_colours(tick)
        self._series = np.where(placed, colours, self._series)
        if tick.hierarchy is not None:
            colours = np.where(tick.hierarchy.role == DISTRESS, palette.IN_DISTRESS, colours)
        return np.where(tick.alive, colours, palette.NOT_RUNNING)

    def _place_colours(self, tick: Tick) -> palette.Colours:
        """Return the colours of the places that agents claim (N,), each by its own mission."""
        missions = sorted(self._shared)
        colours = palette.place_colours(tick.place, self._shared[missions[0]])
        for mission in missions[1:]:
            flown = tick.mission >= mission
            if flown.any():
                newer = palette.place_colours(tick.place, self._shared[mission])
                colours = np.where(flown, newer, colours)
        return colours


def _shared_places(formation: Formation) -> NDArray[np.int16]:
    """Return the places that belong to several queues (K, 2)."""
    return np.array(formation.common, dtype=np.int16).reshape(-1, 2)
