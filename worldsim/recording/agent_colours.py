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
        place = np.stack([tick.place for tick in ticks])
        alive = np.stack([tick.alive for tick in ticks])
        placed = place[..., 0] >= 0
        forms = np.logical_or.accumulate(placed.any(axis=1)) | self._forms
        self._forms = bool(forms[-1])
        colours = self._place_colours(ticks, place)
        self._note_series(placed, colours)
        for row, tick in enumerate(ticks):
            if tick.hierarchy is not None:
                colours[row, tick.hierarchy.role == DISTRESS] = palette.IN_DISTRESS
        colours = np.where(forms[:, None], colours, self._own)
        colours[~alive] = palette.NOT_RUNNING
        colours[np.stack(dead)] = palette.DEAD
        return colours.astype(np.uint32)

    def series(self) -> palette.Colours:
        """Return the colours of agents' curves (N,), as of the last tick."""
        return self._series.copy()

    def _note_series(self, placed: NDArray[np.bool_], colours: palette.Colours) -> None:
        """Note the colour of the last place that each agent claims in a block."""
        last = len(placed) - 1 - np.argmax(placed[::-1], axis=0)
        latest = colours[last, np.arange(placed.shape[1])]
        self._series = np.where(placed.any(axis=0), latest, self._series)

    def _place_colours(self, ticks: Sequence[Tick], place: NDArray[np.int16]) -> palette.Colours:
        """Return the colours of the places that agents claim (T, N), each by its own mission."""
        flat, shape = place.reshape(-1, 2), place.shape[:2]
        missions = sorted(self._shared)
        colours = palette.place_colours(flat, self._shared[missions[0]]).reshape(shape)
        flown = np.stack([tick.mission for tick in ticks]) if missions[1:] else None
        for mission in missions[1:]:
            if flown is not None and (flown >= mission).any():
                newer = palette.place_colours(flat, self._shared[mission]).reshape(shape)
                colours = np.where(flown >= mission, newer, colours)
        return colours


def _shared_places(formation: Formation) -> NDArray[np.int16]:
    """Return the places that belong to several queues (K, 2)."""
    return np.array(formation.common, dtype=np.int16).reshape(-1, 2)
