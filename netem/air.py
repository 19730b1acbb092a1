"""A channel's rate: one frame after the other, and no more than ``limit`` that wait."""

from collections import deque


class Air:
    """What one sender's channel still has to send: when each frame will be out [s], oldest first.

    A link with a rate of its own has one too, for the frames that get that far.
    """

    def __init__(self) -> None:
        self._out_s: deque[float] = deque()

    def enter(self, now_s: float, size_b: int, rate_kbit: float, limit: int) -> float | None:
        """Return how long a frame waits and is on the air [s]; None where the queue is full.

        limit: how many frames there may be in it, the one that is being sent included.
        """
        queue = self._out_s
        while queue and queue[0] <= now_s:
            queue.popleft()
        if len(queue) >= limit:
            return None
        begins_s = queue[-1] if queue else now_s
        queue.append(begins_s + size_b * 8.0 / (rate_kbit * 1000.0))
        return queue[-1] - now_s
