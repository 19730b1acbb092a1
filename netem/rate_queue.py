"""A sender's queue: frames leave one after the other at a rate, and a limited number may wait."""

from collections import deque
from math import inf


class RateQueue:
    """The frames that one sender has not finished sending on one channel.

    A link with a rate of its own has such a queue too, for the frames that the link does not lose.
    """

    def __init__(self) -> None:
        self._waiting: deque[tuple[float, int]] = deque()
        """Time at which each frame has left [s] and its size [B], oldest first."""
        self._rate_kbit = inf

    def enter(self, now_s: float, size_b: int, rate_kbit: float, limit: int) -> float | None:
        """Return how long a frame waits and is on the air [s]; None where the queue is full.

        limit: greatest number of frames in the queue, with the one being sent. When the rate has
        changed since the last frame, all that still waits is sent at the new rate.
        """
        waiting = self._waiting
        while waiting and waiting[0][0] <= now_s:
            waiting.popleft()
        if rate_kbit != self._rate_kbit:
            self._change_rate(now_s, rate_kbit)
        if len(waiting) >= limit:
            return None
        return self._append(now_s, size_b) - now_s

    def _change_rate(self, now_s: float, rate_kbit: float) -> None:
        """Reschedule what waits: a backlog must not outlast the slow rate that caused it."""
        self._rate_kbit = rate_kbit
        sizes_b = [size_b for _, size_b in self._waiting]
        self._waiting.clear()
        for size_b in sizes_b:
            self._append(now_s, size_b)

    def _append(self, now_s: float, size_b: int) -> float:
        """Put a frame at the end of the queue; return the time at which it has left [s]."""
        starts_s = self._waiting[-1][0] if self._waiting else now_s
        left_s = starts_s + size_b * 8.0 / (self._rate_kbit * 1000.0)
        self._waiting.append((left_s, size_b))
        return left_s
