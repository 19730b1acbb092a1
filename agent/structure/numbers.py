"""Which number an agent takes in its queue (Algorithm 1, target-on-queue; E17).

The first number is the own one in the order along the queue, once an agent knows of as many members
as its leader counts. Else it follows from the distances to the vertex, or from the leader's
histogram of them. Of two agents with one number the one that claimed it from farther
away moves on; a leader that has one, since its vertex is taken (E18), keeps it. Who moves on takes
a number known to be free, or pushes into the next one; so a push runs up to the tail. Gaps close
inwards.
"""

from math import inf
from typing import Final

from agent.controller import Heard
from agent.messages import MAX_TEAM, Swap
from agent.structure import histogram
from agent.structure.claim import Claim
from agent.structure.view import View, leads

CONFLICT_M: Final = 0.05
"""Of two claims the nearer by more than this keeps the number, else the lower id (E17)."""
LATE_S, LATE_LATENCIES = 6.0, 20.0
"""Who has no number so long after it took off comes late: it takes the nearest and pushes."""
GREW_WITHIN_S, GREW_BY = 12.0, 1.3
"""A number taken when fewer members were known is taken anew, if so many more turn up so soon."""
COMPLETE_GAP_S, GAP_S, FAR_GAP_S = 0.25, 0.5, 1.0
"""How long a number has not been heard until it counts as a gap."""
NEAR_M: Final = 1.0
STANDS_M: Final = 0.2
"""Who is nearer than this to a place when the numbers are taken stands in it."""


class Numbers:
    """One agent's number in its queue. started_s: when it took the mission [s]."""

    def __init__(self, own_id: int, started_s: float) -> None:
        self._own_id = own_id
        self._started_s = started_s
        self._seen_s: dict[tuple[int, int], float] = {}
        """When each number of a queue was last heard to be claimed [s]."""
        self._holder: dict[tuple[int, int], int] = {}
        """Who was last heard to claim it."""
        self._first_count, self._first_s = 0, 0.0
        self._unequal_s = inf
        """Since when the agent waits, for it knows of fewer or more members than the leader [s]."""

    def take_first(self, view: View, claim: Claim) -> None:
        """Take a number, once the leader has counted the team."""
        home = view.home_of(claim.queue)
        if home is None or not home.go or view.now_s - self._started_s < view.timing.listen_s:
            return
        same = view.same_queue(claim.queue)
        joins = self._joins_late(view, claim)
        if not joins and self._waits(view, claim.queue, same):
            return
        self._unequal_s = inf
        known = (view.counts[claim.queue], view.shares[claim.queue], len(same) + 1)
        self._first_count = max(known)
        self._first_s = self._first_s or view.now_s
        if joins:
            self._join(view, claim)
        else:
            self._claim(view, claim, self._first(view, claim, same))

    def _joins_late(self, view: View, claim: Claim) -> bool:
        """Whether the others have their numbers already. Who led for a moment has had none yet."""
        if self._first_s > 0.0:
            return claim.ranked
        late_s = LATE_S + LATE_LATENCIES * view.timing.latency_s
        return view.now_s - self._started_s > late_s

    def _waits(self, view: View, queue: int, same: list[Heard]) -> bool:
        """Whether the agent waits until it knows of as many members as the leader."""
        count = view.counts[queue]
        if len(view.order) == count or len(same) + 1 >= count or self._stands(view, queue):
            return False
        self._unequal_s = min(self._unequal_s, view.now_s)
        return view.now_s - self._unequal_s < view.timing.resettle_s

    def _stands(self, view: View, queue: int) -> bool:
        """Whether the agent stands in a place of the queue by chance."""
        standing = view.nearest_number(queue, max(1, view.shares[queue]))
        return view.distance(queue, standing) < STANDS_M

    def _join(self, view: View, claim: Claim) -> None:
        """Take the nearest number of a queue that stands already, and push."""
        members = max(view.counts[claim.queue], 0) + 1
        number = view.nearest_number(claim.queue, members)
        taken = view.map.blocked_numbers(claim.queue, view.blocked)
        self._claim(view, claim, _available(number, taken))
        claim.push_until_s = view.now_s + view.timing.push_s

    def _first(self, view: View, claim: Claim, same: list[Heard]) -> int:
        """Return the first number, or the free one next to it if it is occupied."""
        queue = claim.queue
        occupied = self._occupied(view, same)
        taken = view.map.blocked_numbers(queue, view.blocked)
        number, last = self._expected(view, queue, same, taken)
        last = _nth_available(last, taken)
        free = [k for k in range(1, last + 1) if k not in occupied and k not in taken]
        if number in occupied and free:
            number = min(free, key=lambda k: abs(k - number))
        return number

    def _expected(
        self, view: View, queue: int, same: list[Heard], taken: frozenset[int]
    ) -> tuple[int, int]:
        """Return the number that is the agent's if each member has one, and how many have one.

        taken: numbers that nobody can have, for a body is in the place.
        """
        count, share = view.counts[queue], max(1, view.shares[queue])
        most = max(count, share)
        if view.map.closed[queue]:
            return _available(view.nearest_number(queue, most), taken), most
        if len(view.order) == count and self._own_id in view.order:
            return _nth_available(1 + view.order.index(self._own_id), taken), most
        vertex = view.map.home[queue]
        own = (view.to_vertex(vertex), self._own_id)
        nearer = sum((view.to_vertex(vertex, h.position), h.id) < own for h in same)
        if len(same) + 1 >= count:
            return _nth_available(1 + nearer, taken), most
        if self._stands(view, queue):
            return _available(view.nearest_number(queue, share), taken), share
        home = view.home_of(queue)
        bins = home.histogram if home is not None else b""
        if sum(bins):
            nearer = min(share - 1, int(histogram.share_nearer(bins, own[0]) * share))
        return _nth_available(1 + nearer, taken), share

    def keep_up(self, view: View, claim: Claim) -> bool:
        """Resolve a conflict, or close a gap; return whether the number changed."""
        same = view.same_queue(claim.queue)
        if self._grew(view, claim):
            claim.give_up(claim.queue, view.now_s)
            claim.ranked = False
            return True
        occupied = self._occupied(view, same)
        for other in same:
            self._note_holder(view, claim.queue, other)
        if view.now_s - claim.since_s <= view.timing.hold_s:
            return False
        return self._resolve(view, claim, same, occupied) or self._close_gap(
            view, claim, same, occupied
        )

    def _grew(self, view: View, claim: Claim) -> bool:
        """Whether so many more members turned up that the number is to be taken anew."""
        early = view.now_s - self._first_s < GREW_WITHIN_S
        many = view.counts[claim.queue] > GREW_BY * self._first_count + 1
        if not (early and many and self._first_count) or claim.swapping or claim.leads:
            return False
        settled = view.distance(claim.queue, claim.number) <= NEAR_M
        return not settled and not claim.pushes(view.now_s)

    def _resolve(self, view: View, claim: Claim, same: list[Heard], occupied: set[int]) -> bool:
        """Move on from a number, or from a blocked one, if another has the better claim."""
        taken = view.map.blocked_numbers(claim.queue, view.blocked)
        lost = claim.number in taken or any(
            self._loses_to(view, claim, other)
            for other in same
            if view.number_of(other) == claim.number
        )
        if not lost:
            return False
        count = view.counts[claim.queue]
        if len(same) + 1 >= count > 0:
            last = _nth_available(count, taken)
            free = [k for k in range(1, last + 1) if k not in occupied and k not in taken]
            if free:
                self._claim(view, claim, min(free, key=lambda k: view.distance(claim.queue, k)))
                return True
        self._claim(view, claim, self._next(view, claim, taken))
        claim.push_until_s = view.now_s + view.timing.push_s
        return True

    def _next(self, view: View, claim: Claim, taken: frozenset[int]) -> int:
        """Return the next number up the queue; after its last it begins again."""
        number = _available(claim.number + 1, taken)
        last = view.extent(claim.queue) if view.map.closed[claim.queue] else MAX_TEAM
        if number > last:
            return _available(1, taken)
        return number

    def _loses_to(self, view: View, claim: Claim, other: Heard) -> bool:
        standing = other.standing
        if standing is None:
            return False
        if leads(other) != claim.leads:
            return leads(other)
        if _is_for(standing.reservation, self._own_id) or _is_for(claim.reservation, other.id):
            return False
        if standing.pushes != claim.pushes(view.now_s):
            return standing.pushes
        theirs = other.cost_m if other.cost_m is not None else inf
        if abs(theirs - claim.cost_m) <= CONFLICT_M:
            return other.id < self._own_id
        return theirs < claim.cost_m

    def _close_gap(self, view: View, claim: Claim, same: list[Heard], occupied: set[int]) -> bool:
        """Move inwards where nobody is heard to stand below, unless they lack the mission yet."""
        queue, number, count = claim.queue, claim.number, view.counts[claim.queue]
        taken = view.map.blocked_numbers(queue, view.blocked)
        if view.is_under_way:
            return False
        if len(same) + 1 >= count > 0:
            return self._close_all_gaps(view, claim, occupied, taken)
        below = _below(number, taken)
        if below < 1 or below in occupied or self._is_kept(view, queue, below):
            return False
        latency_s = view.timing.latency_s
        empty_s = view.now_s - max(self._seen_s.get((queue, below), 0.0), claim.since_s)
        if view.home_of(queue) is not None and view.highest[queue] <= _nth_available(count, taken):
            return False
        near = view.distance(queue, number) < NEAR_M
        lower = [k for k in occupied if k < number]
        wait_s = (GAP_S if near or not lower else FAR_GAP_S) + latency_s
        if empty_s <= wait_s or not (near or lower):
            return False
        self._claim(view, claim, _available(max(lower, default=0) + 1, taken))
        return True

    def _close_all_gaps(
        self, view: View, claim: Claim, occupied: set[int], taken: frozenset[int]
    ) -> bool:
        """Close all gaps below at once, as each agent above them does, where all are heard."""
        gaps = [
            k
            for k in range(1, claim.number)
            if k not in occupied and k not in taken and self._is_free(view, claim, k)
        ]
        if not gaps:
            return False
        number = claim.number
        for _ in gaps:
            number = _below(number, taken)
        self._claim(view, claim, max(number, _available(1, taken)))
        return True

    def _is_free(self, view: View, claim: Claim, number: int) -> bool:
        """Whether a number has no holder: it was not heard for a while, or announces another."""
        place = (claim.queue, number)
        if self._is_kept(view, *place):
            return False
        if self._holder.get(place) in view.by_id:
            return True
        empty_s = view.now_s - max(self._seen_s.get(place, 0.0), claim.since_s)
        return empty_s > COMPLETE_GAP_S + view.timing.latency_s

    def _note_holder(self, view: View, queue: int, other: Heard) -> None:
        place = (queue, view.number_of(other))
        self._seen_s[place] = view.now_s
        self._holder[place] = other.id

    def _is_kept(self, view: View, queue: int, number: int) -> bool:
        """Whether somebody heard keeps a number for its partner in a swap."""
        place = view.map.place(queue, number)
        return any(
            h.standing is not None
            and h.standing.reservation is not None
            and h.standing.reservation.place == place
            for h in view.heard
        )

    def _occupied(self, view: View, same: list[Heard]) -> set[int]:
        return {number for other in same if (number := view.number_of(other)) > 0}

    def _claim(self, view: View, claim: Claim, number: int) -> None:
        claim.take(claim.queue, number, view.distance(claim.queue, number), view.now_s)


def _is_for(reservation: Swap | None, agent: int) -> bool:
    return reservation is not None and reservation.partner == agent


def _available(number: int, taken: frozenset[int]) -> int:
    """Return the first number from this one on that is not taken by a body."""
    while number in taken:
        number += 1
    return number


def _below(number: int, taken: frozenset[int]) -> int:
    """Return the next lower number that is not taken by a body; 0 for none."""
    number -= 1
    while number in taken:
        number -= 1
    return number


def _nth_available(n: int, taken: frozenset[int]) -> int:
    """Return the n-th number that is not taken by a body."""
    number = 0
    for _ in range(n):
        number = _available(number + 1, taken)
    return number
