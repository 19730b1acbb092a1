"""Swaps of places between two agents that both gain by it, by proposal and answer (E24).

The proposer names both places. The partner takes the proposer's place and keeps its own for it (a
*reservation*) until the proposer is heard there. While a swap is under way an agent does nothing
else with its place.
"""

from typing import Final

from agent.controller import Heard
from agent.messages import Swap, Vector
from agent.structure.claim import Claim
from agent.structure.view import View, leads

GAIN_M2: Final = 0.5
"""Least gain of a swap, in the sum of squared distances [m^2]."""
ACCEPTED_SHARE: Final = 0.5
"""The partner accepts from this share of the gain: the two see each other at different times."""
FRESH_S: Final = 0.4
PAUSE_S, PAUSE_STEP_S = 0.1, 0.1
EXTRAPOLATED_S: Final = 0.5


class Swaps:
    """One agent's swaps."""

    def __init__(self, own_id: int) -> None:
        self._own_id = own_id
        self._tries = 0

    def proceed(self, view: View, claim: Claim) -> bool:
        """Carry on the swaps under way; return whether the place changed or must stay."""
        if claim.reservation is None and self._complete_for_partner(view, claim):
            return True
        if claim.proposal is not None and self._answered(view, claim, claim.proposal):
            return True
        if claim.reservation is not None:
            self._release(view, claim, claim.reservation)
        free = claim.reservation is None and not claim.pushes(view.now_s)
        return (free and self._accept(view, claim)) or claim.proposal is not None

    def _complete_for_partner(self, view: View, claim: Claim) -> bool:
        """Take the place that another keeps for the own agent, having taken its place."""
        own = view.map.place(claim.queue, claim.number)
        for other in view.heard:
            kept = other.standing.reservation if other.standing is not None else None
            if kept is None or kept.partner != self._own_id or other.place != own:
                continue
            if view.point(kept.place[0], view.map.number(kept.place)) is not None:
                self._take(view, claim, kept.place)
                return True
        return False

    def _answered(self, view: View, claim: Claim, proposal: Swap) -> bool:
        """Whether the partner has taken the own place; drops a proposal without an answer."""
        other = view.by_id.get(proposal.partner)
        kept = other.standing.reservation if other is not None and other.standing else None
        agreed = kept == Swap(self._own_id, proposal.other, proposal.place)
        if agreed and other is not None and other.place == proposal.place:
            self._take(view, claim, proposal.other)
            return True
        own = view.map.place(claim.queue, claim.number)
        stale = view.now_s - claim.proposed_s > view.timing.pending_s
        if other is None or other.place != proposal.other or own != proposal.place or stale:
            claim.proposal = None
            self._tries += 1
            wait_s = PAUSE_S + PAUSE_STEP_S * ((7 * self._own_id + self._tries) % 5)
            claim.no_swap_before_s = view.now_s + wait_s
        return False

    def _release(self, view: View, claim: Claim, kept: Swap) -> None:
        """Stop keeping a place once the partner has it, or is not heard to take it."""
        other = view.by_id.get(kept.partner)
        late = view.now_s - claim.reserved_s > view.timing.pending_s + 0.5
        if other is None or other.place == kept.place or late:
            claim.reservation = None

    def _accept(self, view: View, claim: Claim) -> bool:
        """Accept the best proposal heard; return whether there is one."""
        own = view.map.place(claim.queue, claim.number)
        best: tuple[float, Heard] | None = None
        for other in view.heard:
            asked = other.standing.proposal if other.standing is not None else None
            if asked is None or asked.partner != self._own_id or asked.other != own:
                continue
            if other.place != asked.place or other.age_s > FRESH_S + 2.0 * view.timing.latency_s:
                continue
            if claim.proposal is not None and not self._yields(claim.proposal, other):
                continue
            if view.gathering and _apart(view, claim, other):
                continue
            gain = _gain(view, view.point(claim.queue, claim.number), other)
            if gain > ACCEPTED_SHARE * GAIN_M2 and (best is None or gain > best[0]):
                best = gain, other
        if best is None or best[1].place is None:
            return False
        taken = best[1].place
        self._take(view, claim, taken)
        claim.reservation = Swap(best[1].id, own, taken)
        claim.reserved_s = view.now_s
        return True

    def _yields(self, proposal: Swap, other: Heard) -> bool:
        """Whether the own proposal gives way to the one of its partner."""
        return proposal.partner == other.id and self._own_id > other.id

    def propose(self, view: View, claim: Claim) -> None:
        """Propose the swap that gains most, if any gains enough.

        In a queue that has members to give away, orders come first. While a mission is under way,
        those who have it are on their new ways and the others are not: a swap would gain nothing.
        """
        now_s, timing = view.now_s, view.timing
        waits = now_s < claim.no_swap_before_s or now_s - claim.since_s <= timing.hold_s
        if waits or view.is_under_way or claim.swapping or claim.pushes(now_s):
            return
        mine = view.point(claim.queue, claim.number)
        best: tuple[float, Heard] | None = None
        for other in view.heard:
            if not self._may_swap(view, other) or (view.gathering and _apart(view, claim, other)):
                continue
            gain = _gain(view, mine, other)
            if gain > GAIN_M2 and (best is None or gain > best[0]):
                best = gain, other
        if best is not None and best[1].place is not None and claim.queue not in view.transfers:
            own = view.map.place(claim.queue, claim.number)
            claim.proposal = Swap(best[1].id, own, best[1].place)
            claim.proposed_s = now_s

    def _may_swap(self, view: View, other: Heard) -> bool:
        standing = other.standing
        if standing is None or leads(other) or view.number_of(other) < 1 or standing.pushes:
            return False
        busy = standing.proposal is not None or standing.reservation is not None
        return not busy and other.age_s <= FRESH_S + view.timing.latency_s

    def _take(self, view: View, claim: Claim, place: tuple[int, int]) -> None:
        queue, number = place[0], view.map.number(place)
        claim.take(queue, number, view.distance(queue, number), view.now_s)


def _gain(view: View, mine: Vector | None, other: Heard) -> float:
    """Return by how much a swap lowers the sum of squared distances [m^2].

    mine: the own place [m; world frame], None where there is none.
    """
    place = other.place
    theirs = view.point(place.queue, view.number_of(other)) if place is not None else None
    if mine is None or theirs is None:
        return 0.0
    x, y, z = view.here
    u, v, w = other.position
    a, b, c = mine
    d, e, f = theirs
    return 2.0 * ((x - u) * (d - a) + (y - v) * (e - b) + (z - w) * (f - c))


def _apart(view: View, claim: Claim, other: Heard) -> bool:
    """Whether the two are of different queues, one of which is displaced: so is what they gain."""
    queues = {claim.queue, other.place.queue if other.place is not None else 0}
    return len(queues) > 1 and not view.gathering.isdisjoint(queues)
