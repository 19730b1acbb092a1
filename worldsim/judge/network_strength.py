"""The strength of the team's network: its algebraic connectivity, lambda_2 (Fiedler).

It is the second smallest eigenvalue of the graph's Laplacian: 0 where the team is parted, N where
each of N agents hears each.
"""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from worldsim.judge.connectivity import Connectivity
from worldsim.judge.radio_events import RadioRunEvent
from worldsim.judge.tick import Tick
from worldsim.scenario.tables import Scenario

DIGITS: Final = 9
"""Eigenvalues differ in the last digits from one machine to another."""


class NetworkStrength:
    """Finds the least lambda_2 of the running agents over the ticks that count.

    Two agents are neighbours where beacons get through both ways.
    """

    def __init__(self, scenario: Scenario) -> None:
        self._connectivity = Connectivity(scenario)
        self._linked_last: bytes = b""
        self._lambda2: float | None = None
        self.least: float | None = None
        """None before a tick counted that had two running agents."""

    def handle_event(self, event: RadioRunEvent) -> None:
        """Apply the radio fault that an event reports."""
        self._connectivity.handle_event(event)

    def see(self, tick: Tick) -> None:
        """Take a tick that counts."""
        heard = self._connectivity.heard(tick)[np.ix_(tick.alive, tick.alive)]
        linked = heard & heard.T
        key = linked.tobytes()
        if key != self._linked_last:
            self._linked_last, self._lambda2 = key, algebraic_connectivity(linked)
        if self._lambda2 is not None:
            self.least = self._lambda2 if self.least is None else min(self.least, self._lambda2)


def algebraic_connectivity(linked: NDArray[np.bool_]) -> float | None:
    """Return lambda_2 of an undirected graph; None for fewer than two nodes. linked: (N, N)."""
    if len(linked) < 2:
        return None
    laplacian = np.diag(linked.sum(axis=1)) - linked.astype(np.float64)
    return round(max(0.0, float(np.linalg.eigvalsh(laplacian)[1])), DIGITS)
