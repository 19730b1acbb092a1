"""The convergence of each queue by itself, which may come before that of the whole formation.

A queue's residual is the largest slot error among the agents that hold its places. A shared vertex
is a place of every queue that passes through it.
"""

from collections.abc import Sequence
from math import isnan, nan

import numpy as np

from agent.messages import Place
from worldsim.judge.phase import ConvergenceTimer, Phase
from worldsim.judge.tick import Tick, same_claims
from worldsim.scenario.tables import CONVERGED_M


class QueueConvergence:
    """Watches the queues of one phase.

    A queue is in place while each of its agents is within 0.12 m of its slot, and every agent of
    the team has a place: an agent without one may belong to this queue.
    """

    def __init__(self, phase: Phase) -> None:
        self.names = tuple(queue.name for queue in phase.formation.queues)
        self._phase = phase
        self._timers = [ConvergenceTimer() for _ in self.names]
        self._members: list[list[int]] = [[] for _ in self.names]
        """The rows of each queue's agents."""
        self._members_of: Tick | None = None
        """The tick that they were found in."""
        self._all_placed = False

    @property
    def converge_s(self) -> list[float | None]:
        """For each queue, the time from the phase's start to its first 2 s in place [s]."""
        converged = (timer.converged_s for timer in self._timers)
        return [None if at_s is None else at_s - self._phase.from_s for at_s in converged]

    def see(self, tick: Tick, error: Sequence[float]) -> list[float]:
        """Take the slot errors [m] of all agents at a tick; return each queue's residual [m].

        A residual is infinite where an agent of the queue has no valid slot, and NaN where the
        queue has no agents.
        """
        if self._members_of is None or not same_claims(self._members_of, tick):
            self._members_of = tick
            self._find_members(tick)
        residuals_m = [_largest([error[row] for row in rows]) for rows in self._members]
        for timer, residual_m in zip(self._timers, residuals_m, strict=True):
            timer.see(tick.time_s, self._all_placed and residual_m <= CONVERGED_M)
        return residuals_m

    def _find_members(self, tick: Tick) -> None:
        claims = self._phase.claims(tick)
        living = np.flatnonzero(tick.alive).tolist()
        self._all_placed = bool(living) and all(claims[row][0] >= 0 for row in living)
        self._members = [[] for _ in self.names]
        for row in living:
            for queue in self._phase.formation.queues_of(Place(*claims[row])):
                if 0 <= queue < len(self.names):
                    self._members[queue].append(row)


def _largest(distances: Sequence[float]) -> float:
    """Return the largest of some distances; NaN where there is none, or one is NaN."""
    largest = -1.0
    for each in distances:
        if not each <= largest:
            largest = each
            if isnan(each):
                break
    return largest if largest >= 0.0 else nan
