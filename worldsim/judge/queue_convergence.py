"""The queues of a formation, each by itself: a queue may stand before the whole formation does.

A queue's residual is the largest slot error among those who hold its places, a shared vertex being
a place of every queue that passes through it.
"""

import numpy as np
from numpy.typing import NDArray

from agent.messages import Place
from worldsim.judge.metrics import Floats
from worldsim.judge.phase import CONVERGED_M, CONVERGED_S, Phase
from worldsim.judge.tick import Tick


class Queues:
    """Watches the queues of one phase. formed_s: when each first stood for 2 s [s]; None: never.

    A queue stands while everybody in it is within 0.12 m of its slot, and nobody of the team is
    still without a place: it might be one of this queue.
    """

    def __init__(self, phase: Phase) -> None:
        self.names = tuple(queue.name for queue in phase.formation.queues)
        self.formed_s: list[float | None] = [None] * len(self.names)
        self._phase = phase
        self._since_s: list[float | None] = [None] * len(self.names)
        self._seen: tuple[bytes, ...] = ()
        self._members: NDArray[np.bool_] = np.zeros((len(self.names), 0), dtype=np.bool_)
        self._placed = False

    def see(self, tick: Tick, error: Floats) -> Floats:
        """Take the slot errors (N,) [m] at a tick; return each queue's residual [m].

        Infinite where somebody in it has no valid slot, NaN where it has nobody.
        """
        seen = (tick.place.tobytes(), tick.alive.tobytes(), tick.mission.tobytes())
        if seen != self._seen:
            self._seen = seen
            self._divide(tick)
        worst: Floats = np.max(np.where(self._members, error, -np.inf), axis=1, initial=-np.inf)
        if None in self.formed_s:
            for queue, residual_m in enumerate(worst.tolist()):
                self._watch(queue, tick.time_s, self._placed and 0.0 <= residual_m <= CONVERGED_M)
        return np.where(worst >= 0.0, worst, np.nan)

    def _divide(self, tick: Tick) -> None:
        """Find who is in which queue."""
        claims = self._phase.claims(tick)
        living = np.flatnonzero(tick.alive).tolist()
        self._placed = bool(living) and all(claims[row][0] >= 0 for row in living)
        self._members = np.zeros((len(self.names), len(claims)), dtype=np.bool_)
        for row in living:
            for queue in self._phase.formation.queues_of(Place(*claims[row])):
                if 0 <= queue < len(self.names):
                    self._members[queue, row] = True

    def _watch(self, queue: int, time_s: float, stands: bool) -> None:
        since_s = self._since_s[queue]
        if not stands:
            self._since_s[queue] = None
        elif since_s is None:
            self._since_s[queue] = time_s
        elif self.formed_s[queue] is None and time_s - since_s >= CONVERGED_S - 1e-9:
            self.formed_s[queue] = since_s - self._phase.from_s
