"""What a label of the census says of a member, in one byte: its queue and stretch, or its vertex.

A queue is cut into stretches across its line. A member's stretch is the one in which it joined the
queue. By these all members find the same order along the queue, and so each its number. Along a
straight queue this order makes the sum of the squared ways least: what a way has across the queue
is the same for each of its places.
"""

from functools import lru_cache
from typing import Final

from agent.messages import Vector
from agent.structure.queue_map import QueueMap

CODES: Final = 256
"""Number of codes; 0 is of a member of which nothing is known."""
UNPLACED: Final = 1
"""Code of a member without a queue."""
FIRST_QUEUE: Final = 2
FIRST_VERTEX: Final = 128
"""Codes from the first one on are of queues, from the second one on of vertices."""
BEFORE, BEYOND, MARGIN = 0.3, 1.5, 2.0
"""The stretches begin so many lengths of an even queue before its home, and end so many behind it,
with so many places more at both ends."""


class LabelCodes:
    """The codes of one formation. ids: number of agent ids of the run."""

    def __init__(self, formation: QueueMap, ids: int) -> None:
        self._map = formation
        self._stretches = max(1, (FIRST_VERTEX - FIRST_QUEUE) // formation.queues)
        self._places = max(1, ids // formation.queues)
        self._begin = -BEFORE * self._places - MARGIN
        self._length = (BEYOND * self._places + MARGIN - self._begin) / self._stretches

    def of_queue(self, queue: int, here: Vector) -> int:
        """Return the code of a member that joins a queue. here [m; target's frame]."""
        along = self._map.along(queue, 2 * self._places, here)
        stretch = min(max(0, int((along - self._begin) / self._length)), self._stretches - 1)
        return FIRST_QUEUE + queue + self._map.queues * stretch


def of_vertex(vertex: int) -> int:
    """Return the code of the holder of a vertex."""
    return FIRST_VERTEX + vertex


@lru_cache(maxsize=256)
def codes_of(queue: int, queues: int) -> tuple[int, ...]:
    """Return the codes of a queue in a formation of so many queues, ascending."""
    return tuple([code for code in range(CODES) if queue_of_code(code, queues) == queue])


def queue_of_code(code: int, queues: int) -> int:
    """Return the queue of a code in a formation of so many queues, -1 for none."""
    return (code - FIRST_QUEUE) % queues if FIRST_QUEUE <= code < FIRST_VERTEX else -1
