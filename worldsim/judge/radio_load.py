"""Whether the radio carries the traffic, from the medium's counters of packets.

Where a sender's queue is full or grows, no bound holds for the time that news takes.
"""

from collections import deque
from math import inf

from worldsim.judge.tick import Packets, Tick

ENDED = ("delivered", "dropped_medium")
"""Counters of the copies that were in flight and are no longer."""


class RadioLoad:
    """Finds the ticks at which the radio is overloaded. It must see every tick."""

    def __init__(self) -> None:
        self._accepted: deque[tuple[float, int]] = deque()
        """When counters came [s; simulated time], and the copies put in flight by then."""
        self._dropped = 0
        self._last: Packets = {}
        self._overloaded = False

    def is_overloaded(self, tick: Tick, longest_s: float) -> bool:
        """Return whether queues drop frames, or some frames wait longer than a radio needs.

        longest_s: the longest time that a frame is in flight where no queue grows [s]; infinite
        for a radio without queues. Between two reports of the counters the last result holds.
        """
        packets = tick.packets
        if longest_s == inf or "in_flight" not in packets:
            self._accepted.clear()
            self._overloaded = False
        elif packets != self._last:
            self._overloaded = self._find(tick.time_s, packets, longest_s)
        self._last = packets
        return self._overloaded

    def _find(self, time_s: float, packets: Packets, longest_s: float) -> bool:
        ended = sum(packets.get(name, 0) for name in ENDED)
        past = self._accepted
        past.append((time_s, ended + packets["in_flight"]))
        while len(past) > 1 and past[1][0] <= time_s - longest_s:
            past.popleft()
        then_s, accepted = past[0]
        dropped, self._dropped = self._dropped, packets.get("dropped_queue", 0)
        waiting = then_s <= time_s - longest_s and ended < accepted
        return waiting or self._dropped > dropped
