"""The agent's own clock, which may be wrong: whether it jumps, and whether others contradict it.

Slots are counted by the vehicle and never go wrong; the time of an observation may. What an agent
keeps with a time says nothing after a jump of its clock.

A stamp in the future cannot come from a slow radio: one of the two clocks is wrong. An agent that
hears such stamps from two others, and from nobody any other one, takes its own clock for wrong. One
liar alone cannot make it do so.
"""

from math import inf
from typing import Final

CONTRADICTED_S: Final = 1.0
"""How long a beacon tells of the own clock, whether it agrees with it or not [s]."""
WITNESSES: Final = 2
"""So many other agents must have clocks ahead of the own one."""

ROUNDING_S: Final = 1e-6


class OwnClock:
    """What one agent knows of its clock.

    slot_s: length of a slot [s]. slack_s: smaller jumps, and smaller differences between two
    agents' clocks, count as none [s].
    """

    def __init__(self, slot_s: float, slack_s: float) -> None:
        self._slot_s, self._slack_s = slot_s, slack_s
        self._slot, self._time_s = -1, 0.0
        self._ahead_s: dict[int, float] = {}
        """When each other agent last stated a later time [s]."""
        self._confirmed_s = -inf

    def jumps(self, slot: int, time_s: float) -> bool:
        """Take the time [s] of an observation; return whether the clock has jumped before it."""
        lasted_s = (slot - self._slot) * self._slot_s
        first, before_s = self._slot < 0, self._time_s
        self._slot, self._time_s = slot, time_s
        if first or abs(time_s - before_s - lasted_s) <= self._slack_s + ROUNDING_S:
            return False
        self._ahead_s.clear()
        self._confirmed_s = -inf
        return True

    def contradict(self, sender: int, now_s: float) -> None:
        """Note that an agent stated a time that is still to come."""
        self._ahead_s[sender] = now_s

    def confirm(self, now_s: float) -> None:
        """Note that an agent stated a time that may be right."""
        self._confirmed_s = now_s
        self._ahead_s.clear()

    def is_behind(self, now_s: float) -> bool:
        """Return whether the clock must be wrong: behind those of all that are heard."""
        if len(self._ahead_s) < WITNESSES or now_s - self._confirmed_s <= CONTRADICTED_S:
            return False
        late = [each for each, at_s in self._ahead_s.items() if now_s - at_s > CONTRADICTED_S]
        for each in late:
            del self._ahead_s[each]
        return len(self._ahead_s) >= WITNESSES
