"""Wall time: when slots are due, and which commands are late."""

import time
from collections.abc import Callable, Iterable

from agent.messages import Command


class Pacer:
    """Paces slots on the wall clock: they are due slot_s apart, from an epoch on.

    When the host stalls for more than a slot, the epoch moves: missed slots are not caught up in a
    burst, and simulated time stands still meanwhile.
    """

    def __init__(self, slot_s: float, clock: Callable[[], float] = time.monotonic) -> None:
        self._slot_s = slot_s
        self._clock = clock
        self._epoch_slot = 0
        self.behind_s = 0.0
        """How far slots have begun late so far, in all, where that was not caught up [s]."""
        self._started_s = self._epoch_s = clock()

    def start(self) -> None:
        """Make slot 0 due now."""
        self._started_s = self._epoch_s = self._clock()

    @property
    def elapsed_s(self) -> float:
        """Wall time since slot 0 was due [s]."""
        return self._clock() - self._started_s

    def left_s(self, slot: int) -> float:
        """Return the wall time until a slot is due [s]; negative when it is overdue."""
        return self._epoch_s + (slot - self._epoch_slot) * self._slot_s - self._clock()

    def begin(self, slot: int) -> None:
        """Note that a slot begins now."""
        late_s = -self.left_s(slot)
        if late_s > self._slot_s:
            self._epoch_s += late_s
            self.behind_s += late_s

    def stand_still(self, seconds: float) -> None:
        """Take this much wall time out of the reckoning [s]: the world stood still as planned."""
        self._started_s += seconds
        self._epoch_s += seconds

    def change(self, slot: int, slot_s: float) -> None:
        """Make the slots after ``slot`` due ``slot_s`` apart; ``slot`` is due as before."""
        self._epoch_s += (slot - self._epoch_slot) * self._slot_s
        self._epoch_slot, self._slot_s = slot, slot_s


class LatenessCounter:
    """Counts late ticks: the command had not arrived by the agent's next slot."""

    def __init__(self, agents: int) -> None:
        self._observed_slot: list[int | None] = [None] * agents
        self._late_slot: list[int | None] = [None] * agents
        """The last slot in which each agent was found late; None: it never was."""
        self._ticks_of, self._late_of = [0] * agents, [0] * agents
        self.ticks = 0
        """Number of ticks whose command was expected, in time or late."""
        self._late = 0

    def observe(self, agent: int, slot: int, latest: Command | None) -> bool:
        """Note that an agent is sent an observation; return whether its last tick was late.

        latest: its newest command so far.
        """
        observed_slot = self._observed_slot[agent]
        self._observed_slot[agent] = slot
        if observed_slot is None:
            return False
        late = latest is None or latest.slot < observed_slot
        self.ticks += 1
        self._late += late
        self._ticks_of[agent] += 1
        self._late_of[agent] += late
        if late:
            self._late_slot[agent] = slot
        return late

    def on_time_since(self, agent: int, slot: int) -> bool:
        """Return whether an agent has answered in time since a slot."""
        late_slot = self._late_slot[agent]
        return late_slot is None or late_slot < slot

    @property
    def latest(self) -> tuple[int, float] | None:
        """The agent that was late most often, and in which share of its ticks; None: none was."""
        shares = [
            (late / ticks, -agent)
            for agent, (late, ticks) in enumerate(zip(self._late_of, self._ticks_of, strict=True))
            if late
        ]
        if not shares:
            return None
        share, agent = max(shares)
        return -agent, share

    def drop_pending(self, agents: Iterable[int]) -> None:
        """Expect no more commands for earlier observations: the agents stopped, or start anew."""
        for agent in agents:
            self._observed_slot[agent] = None

    @property
    def late_fraction(self) -> float | None:
        """Share of late ticks; None before the first tick."""
        return self._late / self.ticks if self.ticks else None
