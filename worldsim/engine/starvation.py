"""CPU starvation: processes of agents that run only for a share of each period.

Each is stopped and continued within each period, which needs no rights, unlike a control group. The
schedule is one of simulated time. So it is the same where no process exists.
"""

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from worldsim.engine.operations import ThrottleProcesses
from worldsim.scenario.timeline import SLACK_S

PERCENT: Final = 0.01


class Share(NamedTuple):
    """The share of CPU time that one fault leaves to an agent."""

    since_s: float  # [s; simulated time]
    cpu_percent: float
    period_s: float  # [s; simulated time]

    def stops(self, time_s: float) -> bool:
        """Return whether the process is stopped at a time [s]: it runs first in each period."""
        in_period_s = (time_s - self.since_s + SLACK_S) % self.period_s
        return in_period_s >= PERCENT * self.cpu_percent * self.period_s


class Starvation:
    """Which processes are starved, and which of them are stopped.

    Of several faults of one agent each stops it in its own time.
    """

    def __init__(self) -> None:
        self._shares: dict[int, dict[int, Share]] = {}
        """By agent and the fault's number."""
        self.stopped: frozenset[int] = frozenset()
        """The agents that are stopped now."""
        self.struck: dict[int, int] = {}
        """How many steps each fault has suppressed, by its number."""

    def __bool__(self) -> bool:
        return bool(self._shares or self.stopped)

    def begin(self, number: int, agent: int, share: Share) -> None:
        """Leave an agent only a share of the time."""
        self._shares.setdefault(agent, {})[number] = share

    def end(self, number: int, agent: int) -> None:
        """End a fault of an agent."""
        shares = self._shares.get(agent, {})
        shares.pop(number, None)
        if not shares:
            self._shares.pop(agent, None)

    def change(self, time_s: float, running: NDArray[np.bool_]) -> ThrottleProcesses | None:
        """Return what is to be done at a time [s]; None where all is as it should be.

        running (N,): the agents that are running. Others are left alone.
        """
        wanted = {
            agent
            for agent, shares in self._shares.items()
            if running[agent] and any(share.stops(time_s) for share in shares.values())
        }
        if wanted == self.stopped:
            return None
        stops = tuple(sorted(wanted - self.stopped))
        continues = tuple(sorted(each for each in self.stopped - wanted if running[each]))
        return ThrottleProcesses(stops, continues, frozenset(wanted))

    def apply(self, operation: ThrottleProcesses) -> None:
        """Note that an operation was carried out."""
        self.stopped = operation.stopped

    def forget(self, agent: int) -> None:
        """Note that an agent's process is not stopped any more: it has ended, or was continued."""
        self.stopped -= {agent}

    def suppresses(self, agent: int, time_s: float) -> bool:
        """Return whether an agent misses its step at a time [s], and count it."""
        if agent not in self.stopped:
            return False
        for number, share in self._shares.get(agent, {}).items():
            if share.stops(time_s):
                self.struck[number] = self.struck.get(number, 0) + 1
        return True
