"""How well a team holds its formation: from its convergence on, outside the time that faults take.

A fault takes its window, from its beginning and from its end. While a fault parts the team, none of
the time counts.
"""

from math import inf

from worldsim.judge.parting_faults import PartingFaults
from worldsim.judge.phase import Phase
from worldsim.judge.tick import Tick


class HeldFormation:
    """Counts the ticks at which the whole team is in its slots.

    window_s: of each fault [s]; parting: the faults that part the team; their owner keeps them.
    """

    def __init__(self, window_s: float, parting: PartingFaults) -> None:
        self._window_s, self._parting = window_s, parting
        self._from_s = -inf
        """When the last fault's window is over [s]."""
        self._ticks = self._in_place = 0
        self._worst_m = -inf

    def open_window(self, t_s: float) -> None:
        """Take the beginning or the end of a fault at a time [s]."""
        self._from_s = t_s + self._window_s

    def disturbed(self, t_s: float) -> bool:
        """Return whether a fault takes the time [s]."""
        return bool(self._parting) or t_s < self._from_s

    def see(self, tick: Tick, phase: Phase, in_place: bool) -> bool:
        """Take a tick, and return whether it counts.

        in_place: whether every running agent is in its slot.
        """
        if phase.converge_s is None or self.disturbed(tick.time_s):
            return False
        self._ticks += 1
        self._in_place += in_place
        worst_m = phase.residual_m if phase.residual_m is not None else inf
        self._worst_m = max(self._worst_m, worst_m)
        return True

    @property
    def in_place_fraction(self) -> float | None:
        """Share of the ticks at which every agent was in its slot; None where none counted."""
        return self._in_place / self._ticks if self._ticks else None

    @property
    def worst_m(self) -> float | None:
        """Largest slot error [m], infinite where an agent had no slot; None where none counted."""
        return self._worst_m if self._ticks else None
