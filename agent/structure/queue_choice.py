"""Which queue an agent belongs to: its own first choice, then its leader's orders.

A new agent takes the nearest queue, or one that lacks members, once a leader has counted them. From
then on only a leader moves it (queue level of Fig. 3). An agent that could leave says so up the
tiers: a candidate, with the extra way that it would have.
"""

from collections.abc import Sequence
from math import inf
from typing import Final

from agent.messages import MAX_TEAM, Candidate, Order
from agent.structure.claim import NO_QUEUE, Claim
from agent.structure.view import View, leads

OFFER_S: Final = 0.5
"""Offers are computed anew after this time, or when the counts change."""


class QueueChoice:
    """One agent's choice of its queue."""

    def __init__(self, own_id: int) -> None:
        self._own_id = own_id
        self._done: dict[int, int] = {}
        """Number of the last order that was seen to, by the leader's id."""
        self._asked: tuple[int, int, tuple[int, ...], tuple[int, ...]] | None = None
        self._offered_s = 0.0
        self._offers: tuple[Candidate, ...] = ()

    def choose(self, view: View, claim: Claim) -> None:
        """Choose a queue: one that lacks members, else the nearest."""
        queue = self._lacking(view)
        if queue is None:
            queue = min(range(view.map.queues), key=lambda j: view.way_to(j, likely_length(view)))
        claim.give_up(queue, view.now_s)

    def _lacking(self, view: View) -> int | None:
        """Return a queue that lacks members; agents without a place take turns by id."""
        if view.latest is None:
            return None
        unplaced = sorted(
            [self._own_id, *(h.id for h in view.heard if view.number_of(h) < 1 and not leads(h))]
        )
        agents = min(max(view.total, sum(view.counts) + len(unplaced)), MAX_TEAM)
        shares = view.map.members(agents, view.blocked)
        lacking = [max(0, share - n) for share, n in zip(shares, view.counts, strict=True)]
        places = [j for j, number in enumerate(lacking) for _ in range(number)]
        if not places:
            return None
        if len(unplaced) == 1:
            return min(sorted(set(places)), key=lambda j: view.way_to(j, view.counts[j] + 1))
        return places[unplaced.index(self._own_id) % len(places)]

    def obey(self, view: View, claim: Claim) -> bool:
        """Follow an order, if there is a new one; return whether there is."""
        for summary in view.summaries:
            if summary is None or summary.order <= self._done.get(summary.root.id, 0):
                continue
            mine = [o for o in summary.orders if o.agent == self._own_id and o.queue == claim.queue]
            if mine and not claim.swapping:
                self._done[summary.root.id] = summary.order
                self._move(view, claim, mine[0])
                return True
        return False

    def _move(self, view: View, claim: Claim, order: Order) -> None:
        if not 0 <= order.to < view.map.queues:
            return
        if claim.number < 1:
            claim.give_up(order.to, view.now_s)
            return
        number = view.nearest_number(order.to, view.counts[order.to] + 1)
        claim.take(order.to, number, view.distance(order.to, number), view.now_s)
        claim.push_until_s = view.now_s + view.timing.push_s

    def candidates(self, view: View, claim: Claim) -> tuple[Candidate, ...]:
        """Return the extra way to each queue that the own one may give to."""
        if claim.queue == NO_QUEUE or claim.leads or claim.swapping or claim.pushes(view.now_s):
            return ()
        takers = view.transfers.get(claim.queue)
        if takers is None:
            return ()
        asked = (claim.queue, claim.number, tuple(view.counts), view.wanted)
        if asked != self._asked or view.now_s - self._offered_s >= OFFER_S:
            self._asked, self._offered_s = asked, view.now_s
            self._offers = self._ways(view, claim, takers)
        return self._offers

    def _ways(self, view: View, claim: Claim, takers: Sequence[int]) -> tuple[Candidate, ...]:
        """Return the extra way to each queue that takes members."""
        own_m = view.distance(claim.queue, claim.number)
        if own_m == inf:  # no number, or one that a full queue has no place for
            own_m = view.way_to(claim.queue, view.counts[claim.queue])
        ways_m = {j: _way_to(view, j) for j, number in enumerate(takers) if number > 0}
        ways_m = {j: way_m for j, way_m in ways_m.items() if way_m < inf}
        if own_m == inf:  # the queue has no place for any member: whoever is in it is to leave
            own_m = max(ways_m.values(), default=0.0)
        return tuple(
            Candidate(round(10.0 * (way_m - own_m)), self._own_id, j) for j, way_m in ways_m.items()
        )


def _way_to(view: View, queue: int) -> float:
    """Return the distance from where the agent would stand in a queue [m].

    The first member of a queue with a vacant vertex will stand in it.
    """
    vacant = [v for v in view.vacant if v in view.map.vertices_of[queue]]
    if vacant and not view.counts[queue]:
        return min(view.to_vertex(v) for v in vacant)
    return view.way_to(queue, view.counts[queue] + 1)


def likely_length(view: View) -> int:
    """Return how many members a queue is likely to have, before anybody has counted them."""
    return max(2, round((view.total or len(view.heard) + 1) / view.map.queues))
