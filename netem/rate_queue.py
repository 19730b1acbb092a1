"""A channel's rate: one frame after the other, and no more than ``limit`` that wait."""

from collections import deque
from math import inf


class RateQueue:
    """What one sender's channel still has to send: when each frame will be out [s], its size [B].

    Oldest first. A link with a rate of its own has one too, for the frames that get that far.
    """

    def __init__(self) -> None:
        self._waiting: deque[tuple[float, int]] = deque()
        self._rate_kbit = inf

    def enter(self, now_s: float, size_b: int, rate_kbit: float, limit: int) -> float | None:
        """Return how long a frame waits and is on the air [s]; None where the queue is full.

        limit: how many frames there may be in it, the one that is being sent included. At another
        rate than the frame before, what still waits goes out at that rate before this frame.
        """
        waiting = self._waiting
        while waiting and waiting[0][0] <= now_s:
            waiting.popleft()
        if rate_kbit != self._rate_kbit:
            self._change(now_s, rate_kbit)
        if len(waiting) >= limit:
            return None
        return self._append(now_s, size_b) - now_s

    def _change(self, now_s: float, rate_kbit: float) -> None:
        """Take another rate; a backlog from a slower time must not outlast that time."""
        self._rate_kbit = rate_kbit
        sizes_b = [size_b for _, size_b in self._waiting]
        self._waiting.clear()
        for size_b in sizes_b:
            self._append(now_s, size_b)

    def _append(self, now_s: float, size_b: int) -> float:
        """Put a frame behind those that wait; return when it will be out [s]."""
        begins_s = self._waiting[-1][0] if self._waiting else now_s
        out_s = begins_s + size_b * 8.0 / (self._rate_kbit * 1000.0)
        self._waiting.append((out_s, size_b))
        return out_s
