"""Wall time: when slots are due, and whether the agents keep up."""

import time
from collections.abc import Callable, Iterable

from agent.messages import Command


class Pacer:
    """Slot k is due at epoch + k slots.

    A host that stalls for more than a slot makes the epoch slip: what was missed is not caught up
    in a burst, simulated time just stands still meanwhile.
    """

    def __init__(self, slot_s: float, clock: Callable[[], float] = time.monotonic) -> None:
        self._slot_s = slot_s
        self._clock = clock
        self._begun = self._epoch = clock()

    def start(self) -> None:
        """Make slot 0 due now."""
        self._begun = self._epoch = self._clock()

    @property
    def elapsed_s(self) -> float:
        """Wall time since slot 0 was due [s]."""
        return self._clock() - self._begun

    def left_s(self, slot: int) -> float:
        """Return how long it is until a slot is due [s]; negative when that has passed."""
        return self._epoch + slot * self._slot_s - self._clock()

    def begin(self, slot: int) -> None:
        """Note that a slot begins now."""
        late_s = -self.left_s(slot)
        if late_s > self._slot_s:
            self._epoch += late_s


class Punctuality:
    """Counts the ticks whose command had not come by the agent's next slot."""

    def __init__(self, agents: int) -> None:
        self._asked: list[int | None] = [None] * agents
        self._ticks = 0
        self._late = 0

    def ask(self, agent: int, slot: int, last: Command | None) -> None:
        """Note that an agent gets an observation; ``last`` is its newest command so far."""
        asked = self._asked[agent]
        self._asked[agent] = slot
        if asked is not None:
            self._ticks += 1
            self._late += last is None or last.slot < asked

    def forget(self, agents: Iterable[int]) -> None:
        """Expect no answer any more to what agents were asked: they stopped, or start anew."""
        for agent in agents:
            self._asked[agent] = None

    @property
    def late_fraction(self) -> float | None:
        """Share of late ticks; None before there was any."""
        return self._late / self._ticks if self._ticks else None
