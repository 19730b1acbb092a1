"""Links over which stamps are rejected, because two agents' clocks differ.

A frame gets across where its age by the receiver's clock is at least minus two ticks and at most
MAX_AGE_S. An agent that hears only clocks ahead of its own is silent (``agent.comms.own_clock``).
"""

import numpy as np
from numpy.typing import NDArray

from agent.comms.neighbours import MAX_AGE_S
from agent.comms.own_clock import WITNESSES
from worldsim.judge.run_events import ClockChanged
from worldsim.truth.agent_clocks import AgentClocks, ClockError

Links = NDArray[np.bool_]
"""(N, N), from the agent of the row to the agent of the column."""


class ClockLinks:
    """The clocks of all agents, and what follows for their links.

    slack_s: how far a stamp may be ahead of the receiver's clock [s].
    """

    def __init__(self, agents: int, slack_s: float) -> None:
        self._agents, self._slack_s = range(agents), slack_s
        self._clocks = AgentClocks()
        self.unclear = False
        """Whether the delay of a frame decides on some link whether the frame is rejected."""
        self.silent = np.zeros(agents, dtype=np.bool_)
        """(N,): the agents that know their clock to be wrong; they take no part in the team."""

    def __bool__(self) -> bool:
        return bool(self._clocks)

    def handle_event(self, event: ClockChanged) -> None:
        """Take the beginning or the end of a clock's fault."""
        self.unclear = False
        self.silent[:] = False
        if event.agent is None:
            return
        if event.ends:
            self._clocks.end(event.number, event.agent)
        else:
            error = ClockError(event.t_s, event.offset_s, event.drift_ppm)
            self._clocks.begin(event.number, event.agent, error)

    def passing(self, reached: Links, time_s: float, longest_s: float) -> Links:
        """Return the links over which frames may be accepted at a time [s].

        reached: the links over which beacons come; longest_s: the longest time in flight [s].
        """
        ahead = np.array([self._clocks.ahead_s(agent, time_s) for agent in self._agents])
        lead = ahead[:, None] - ahead
        future, old = lead - longest_s > self._slack_s, -lead > MAX_AGE_S
        passes: Links = ~(future | old)
        by_delay = (lead > self._slack_s) | ((lead != 0.0) & (longest_s - lead > MAX_AGE_S))
        self.unclear = bool((reached & passes & by_delay).any())
        contradicted = np.count_nonzero(reached & future, axis=0) >= WITNESSES
        self.silent = contradicted & ~(reached & passes).any(axis=0)
        passes[self.silent] = False
        return passes
