"""Time limits of the Q-structure, derived from the radio as an agent measures it."""

from math import log
from typing import Final, final

from agent.controller import UNHEARD, Link

LEAST_SILENCE_S: Final = 1.5
LEAST_PARENT_S: Final = 0.25
LOG_LOST, LOG_PARENT = log(1e-6), log(1e-3)
"""Logarithms of the probability that chance alone makes such a silence."""
LEAST_LOSS: Final = 1e-3
ANSWER_S: Final = 0.15
"""An answer waits so long for the next summary [s]."""
MOST_LOSS: Final = 0.95


@final
class Timing:
    """Time limits for a radio as measured [s]. beacon_period_s: of the local channel."""

    def __init__(self, link: Link, beacon_period_s: float) -> None:
        latency_s, loss = link.latency_s, min(link.loss, MOST_LOSS)
        logarithm = log(max(loss, LEAST_LOSS))
        lost_s = LOG_LOST / logarithm * beacon_period_s
        parent_s = LOG_PARENT / logarithm * beacon_period_s
        self.latency_s, self.loss = latency_s, loss
        self.hop_s = latency_s + beacon_period_s / (1.0 - loss)
        """Mean time until a neighbour has heard a statement."""
        self.listen_s = 0.2 + 1.5 * latency_s
        """Before an election."""
        self.lost_s = max(LEAST_SILENCE_S, lost_s) + latency_s
        """Silence after which a member counts as lost (E17)."""
        self.parent_s = max(LEAST_PARENT_S, parent_s) + latency_s
        """Silence after which a parent is replaced."""
        self.root_s = self.lost_s + 0.5
        """Standstill of its version after which a root is void (E15)."""
        self.hold_s = 0.1 + 2.0 * latency_s
        """A new claim is kept so long, until others may have heard it."""
        self.pending_s = 0.6 + 3.0 * latency_s
        """A proposed swap waits so long for its answer."""
        self.push_s = 1.0 + 3.0 * latency_s
        """A claim pushes so long."""
        self.settle_s = 0.25 + self.hop_s
        """Counts are steady when unchanged for so long, at the start."""
        self.answer_s = 2.0 * (ANSWER_S + latency_s) / (1.0 - loss)
        """Time for a question to all neighbours, and their answer."""
        self.resettle_s = 1.0 + 4.0 * latency_s
        """The same later, when a wrong order would move vehicles for nothing."""


class LinkTiming:
    """The time limits of one agent, found anew only once it has measured the radio again.

    beacon_period_s: of the local channel.
    """

    def __init__(self, beacon_period_s: float) -> None:
        self._beacon_period_s = beacon_period_s
        self._link = UNHEARD
        self._timing = Timing(UNHEARD, beacon_period_s)

    def of(self, link: Link) -> Timing:
        """Return the time limits for a radio as measured."""
        if link is not self._link:
            self._link, self._timing = link, Timing(link, self._beacon_period_s)
        return self._timing
