"""Time limits of the Q-structure, derived from the radio as an agent measures it."""

from dataclasses import dataclass
from functools import lru_cache
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
LINKS_KEPT: Final = 512
"""An agent measures its link now and then, and needs the limits in each step."""


@final
@dataclass
class Timing:
    """Time limits [s]."""

    latency_s: float
    loss: float
    hop_s: float  # mean time until a neighbour has heard a statement
    listen_s: float  # before an election
    lost_s: float  # silence after which a member counts as lost (E17)
    parent_s: float  # silence after which a parent is replaced
    root_s: float  # standstill of its version after which a root is void (E15)
    hold_s: float  # a new claim is kept so long, until others may have heard it
    pending_s: float  # a proposed swap waits so long for its answer
    push_s: float  # a claim pushes so long
    settle_s: float  # counts are steady when unchanged for so long, at the start
    answer_s: float  # time for a question to all neighbours, and their answer
    resettle_s: float  # the same later, when a wrong order would move vehicles for nothing


@lru_cache(LINKS_KEPT)
def timing_of(link: Link, beacon_period_s: float) -> Timing:
    """Return the time limits for a radio as measured. beacon_period_s: of the local channel."""
    latency, loss = link.latency_s, min(link.loss, MOST_LOSS)
    known = max(loss, LEAST_LOSS)
    hop_s = latency + beacon_period_s / (1.0 - loss)
    lost_s = max(LEAST_SILENCE_S, LOG_LOST / log(known) * beacon_period_s) + latency
    parent_s = max(LEAST_PARENT_S, LOG_PARENT / log(known) * beacon_period_s) + latency
    return Timing(
        latency_s=latency,
        loss=loss,
        hop_s=hop_s,
        listen_s=0.2 + 1.5 * latency,
        lost_s=lost_s,
        parent_s=parent_s,
        root_s=lost_s + 0.5,
        hold_s=0.1 + 2.0 * latency,
        pending_s=0.6 + 3.0 * latency,
        push_s=1.0 + 3.0 * latency,
        settle_s=0.25 + hop_s,
        answer_s=2.0 * (ANSWER_S + latency) / (1.0 - loss),
        resettle_s=1.0 + 4.0 * latency,
    )


class LinkTiming:
    """The time limits of one agent, found anew only once it has measured the radio again.

    beacon_period_s: of the local channel.
    """

    def __init__(self, beacon_period_s: float) -> None:
        self._beacon_period_s = beacon_period_s
        self._link = UNHEARD
        self._timing = timing_of(UNHEARD, beacon_period_s)

    def of(self, link: Link) -> Timing:
        """Return the time limits for a radio as measured."""
        if link is not self._link:
            self._link, self._timing = link, timing_of(link, self._beacon_period_s)
        return self._timing
