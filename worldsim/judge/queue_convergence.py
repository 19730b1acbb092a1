"""The convergence of each queue by itself, which may come before that of the whole formation.

A queue's residual is the largest slot error among the agents that hold its places. A shared vertex
is a place of every queue that passes through it.
"""

import numpy as np
from numpy.typing import NDArray

from agent.messages import Place
from worldsim.judge.phase import ConvergenceTimer, Phase
from worldsim.judge.tick import Tick
from worldsim.scenario.tables import CONVERGED_M
from worldsim.truth.vehicle import Floats


class QueueConvergence:
    """Watches the queues of one phase.

    A queue is in place while each of its agents is within 0.12 m of its slot, and every agent of
    the team has a place: an agent without one may belong to this queue.
    """

    def __init__(self, phase: Phase) -> None:
        self.names = tuple(queue.name for queue in phase.formation.queues)
        self._phase = phase
        self._timers = [ConvergenceTimer() for _ in self.names]
        self._members_key: tuple[bytes, ...] = ()
        self._members: NDArray[np.bool_] = np.zeros((len(self.names), 0), dtype=np.bool_)
        self._all_placed = False

    @property
    def converge_s(self) -> list[float | None]:
        """For each queue, the time from the phase's start to its first 2 s in place [s]."""
        converged = (timer.converged_s for timer in self._timers)
        return [None if at_s is None else at_s - self._phase.from_s for at_s in converged]

    def see(self, tick: Tick, error: Floats) -> Floats:
        """Take the slot errors (N,) [m] at a tick; return the residuals (Q,) [m].

        A residual is infinite where an agent of the queue has no valid slot, and NaN where the
        queue has no agents.
        """
        key = (tick.place.tobytes(), tick.alive.tobytes(), tick.mission.tobytes())
        if key != self._members_key:
            self._members_key = key
            self._find_members(tick)
        worst: Floats = np.max(np.where(self._members, error, -np.inf), axis=1, initial=-np.inf)
        for timer, residual_m in zip(self._timers, worst.tolist(), strict=True):
            timer.see(tick.time_s, self._all_placed and 0.0 <= residual_m <= CONVERGED_M)
        return np.where(worst >= 0.0, worst, np.nan)

    def _find_members(self, tick: Tick) -> None:
        claims = self._phase.claims(tick)
        living = np.flatnonzero(tick.alive).tolist()
        self._all_placed = bool(living) and all(claims[row][0] >= 0 for row in living)
        self._members = np.zeros((len(self.names), len(claims)), dtype=np.bool_)
        for row in living:
            for queue in self._phase.formation.queues_of(Place(*claims[row])):
                if 0 <= queue < len(self.names):
                    self._members[queue, row] = True
