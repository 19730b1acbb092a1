"""What one agent claims in the formation: a queue, a number in it, or a vertex that it leads."""

from math import inf
from typing import Final

from agent.messages import MAX_COST_MM, Swap

NO_QUEUE: Final = -1
NO_NUMBER: Final = 0
NO_VERTEX: Final = -1
MOST_COST_M = MAX_COST_MM / 1000.0


class Claim:
    """An agent's claim. ``cost_m``: distance to the place when it was claimed, decides a contest.

    ``since_s``: the last change; ``push_until_s``: until then the claim comes before others'.
    ``ranked``: whether the agent ever had a number; ``changes``: how often it took another one.
    """

    def __init__(self, now_s: float) -> None:
        self.queue, self.number, self.vertex = NO_QUEUE, NO_NUMBER, NO_VERTEX
        self.cost_m = 0.0
        self.since_s = now_s
        self.push_until_s = -inf
        self.ranked = False
        self.proposal: Swap | None = None
        self.proposed_s = 0.0
        self.reservation: Swap | None = None
        self.reserved_s = 0.0
        self.no_swap_before_s = 0.0

    @property
    def leads(self) -> bool:
        """Whether the agent leads a vertex."""
        return self.vertex != NO_VERTEX

    def pushes(self, now_s: float) -> bool:
        """Whether the claim comes before others' now."""
        return now_s < self.push_until_s

    @property
    def swapping(self) -> bool:
        """Whether a swap is under way."""
        return self.proposal is not None or self.reservation is not None

    def take(self, queue: int, number: int, cost_m: float, now_s: float) -> None:
        """Claim a number in a queue.

        cost_m: distance to the place now [m]; infinite where a full queue has no place for it.
        """
        self.queue, self.number, self.since_s = queue, number, now_s
        self.cost_m = min(cost_m, MOST_COST_M)
        self.proposal, self.push_until_s, self.ranked = None, -inf, True

    def lead(self, vertex: int, cost_m: float, now_s: float) -> None:
        """Take the lead of a vertex, and leave the queue's numbers."""
        self.vertex, self.number, self.cost_m, self.since_s = vertex, NO_NUMBER, cost_m, now_s
        self.proposal = self.reservation = None
        self.push_until_s, self.ranked = -inf, True

    def give_up(self, queue: int, now_s: float) -> None:
        """Claim nothing, as a member of a queue or of none."""
        self.queue, self.number, self.vertex, self.since_s = queue, NO_NUMBER, NO_VERTEX, now_s
        self.proposal = self.reservation = None
        self.push_until_s = -inf
