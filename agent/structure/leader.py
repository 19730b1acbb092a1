"""What the leader of a vertex does: it counts, shares out its queues' members, and gives orders.

The census counts the members of each queue. Once the counts have been steady, the leader says go:
agents then take numbers. Where steady counts differ from the shares (largest remainders, E16), it
orders the candidates with the least extra way to change their queue, and gives no new order until
the counts have followed or the time for it is over.
"""

from collections import Counter
from collections.abc import Mapping, Sequence
from math import inf
from typing import Final, NamedTuple

from agent.messages import (
    MAX_ORDERS,
    MAX_TEAM,
    Candidate,
    LeaderSummary,
    Order,
    Place,
    RootKey,
    Subtree,
)
from agent.structure.census import Population
from agent.structure.transfers import transfers
from agent.structure.tree import version_at
from agent.structure.view import View

CANDIDATES: Final = 4
"""Most candidates of a queue for another one that are passed on."""
FOLLOWED_S, FOLLOWED_LATENCIES = 2.5, 6.0
"""How long a leader waits for its orders to show in the counts."""
BEYOND_S, MOST_BEYOND_S = 0.45, 1.2
"""The first counts must be steady for so much longer where the team is three times as large as
those heard, four times and so on."""
COLLECTED_S, COLLECTED_LATENCIES = 1.0, 4.0
"""How long it waits for candidates to come up the tiers, if there are too few; and for even queues
before it says go."""
EXPECTED_S: Final = 4.0
"""How long a leader waits until all that had places in the mission before are counted."""
MOST_WAITS: Final = 2.0
"""Each order begins the wait before go anew, within so many times its length."""


class Counted(NamedTuple):
    """The counts that must be steady."""

    total: int
    members: tuple[int, ...]


class Unevenness(NamedTuple):
    """How the members should be shared out, and what has to move for it."""

    shares: Sequence[int]
    takers: Mapping[int, list[int]]
    """For each queue with too many members how many each other queue may take from it."""


class Leader:
    """The leader of one vertex.

    round_s: time between two rounds of the multihop channel [s]; expected: members of a team that
    took its places over from another mission.
    """

    def __init__(
        self, vertex: int, key: RootKey, now_s: float, round_s: float, expected: int = 0
    ) -> None:
        self._expects, self._expects_until_s = expected, now_s + EXPECTED_S
        self.vertex = vertex
        self._key = key
        self._round_s = round_s
        self._counted: Counted | None = None
        self._since_s = now_s
        self._go = False
        self._order = version_at(now_s)
        self._orders: tuple[Order, ...] = ()
        self._ordered_s = -1e9
        self._expected: tuple[tuple[int, int], ...] = ()
        """Members of each queue before the orders, and after; empty without orders."""
        self._uneven_s: float | None = None
        self._steady_s = inf
        """Since when the queues have been steady, but not even [s]."""

    def summary(
        self, view: View, population: Population, subtree: Subtree, blocked: frozenset[Place]
    ) -> LeaderSummary:
        """Return the summary for now. subtree: what came up the tiers, the own part included."""
        steady = self._is_steady(view, population)
        followed = self._follow_up(view, population)
        uneven = _unevenness(view, population, blocked)
        if steady and not self._expected:
            self._give_orders(view, population.members, uneven, subtree)
        if not self._go and (steady or followed):
            self._go = self._may_go(view, uneven)
        homed = view.map.homed[self.vertex]
        return LeaderSummary(
            root=self._key,
            version=version_at(view.now_s),
            total=min(population.total, MAX_TEAM),
            counts=tuple(min(population.members[j], MAX_TEAM) for j in homed),
            highest=subtree.highest,
            histogram=subtree.histogram,
            go=self._go,
            order=self._order,
            orders=self._orders,
            blocked=tuple(sorted(blocked)),
        )

    def _is_steady(self, view: View, population: Population) -> bool:
        counted = Counted(population.total, population.members)
        if counted != self._counted:
            # What an agent counted before it led counts too.
            self._since_s = view.now_s if self._counted is not None else population.changed_s
            self._counted = counted
        wait_s = view.timing.resettle_s if self._go else self._first_wait_s(view, counted.total)
        if not self._go and counted.total < self._least(view):
            return False
        return view.now_s - self._since_s >= wait_s - 1e-9 and counted.total > 0

    def _least(self, view: View) -> int:
        """Return how many members the first steady count has at least."""
        expected = self._expects if view.now_s < self._expects_until_s else 0
        return max(len(view.heard) + 1, expected)

    def _first_wait_s(self, view: View, total: int) -> float:
        """Return how long the first counts must be steady [s]: longer for news from farther away.

        Numbers taken too early move many agents for nothing, and cost more than the wait.
        """
        beyond = total / (len(view.heard) + 1) - 2.0
        return view.timing.settle_s + min(MOST_BEYOND_S, BEYOND_S * max(0.0, beyond))

    def _may_go(self, view: View, uneven: Unevenness) -> bool:
        """Whether numbers may be taken: the queues are even, or have had the time for it."""
        if not uneven.takers:
            return True
        self._steady_s = min(self._steady_s, view.now_s)
        wait_s = COLLECTED_S + COLLECTED_LATENCIES * view.timing.latency_s
        ordered_s = min(self._ordered_s, self._steady_s + MOST_WAITS * wait_s)
        return view.now_s - max(self._steady_s, ordered_s) > wait_s

    def _follow_up(self, view: View, population: Population) -> bool:
        """Take orders back once they have been followed, or have had the time for it."""
        if not self._expected:
            return False
        wait_s = FOLLOWED_S + FOLLOWED_LATENCIES * view.timing.latency_s + 2.0 * self._round_s
        followed = all(
            now >= after if after > before else now <= after
            for now, (before, after) in zip(population.members, self._expected, strict=True)
            if after != before
        )
        if followed or view.now_s - self._ordered_s > wait_s:
            self._expected, self._orders = (), ()
        return followed

    def _give_orders(
        self, view: View, counts: Sequence[int], uneven: Unevenness, subtree: Subtree
    ) -> None:
        homed = view.map.homed[self.vertex]
        own = {j: uneven.takers[j] for j in homed if j in uneven.takers}
        if not own:
            self._uneven_s = None
            return
        if self._uneven_s is None:
            self._uneven_s = view.now_s
        spare = {j: counts[j] - uneven.shares[j] for j in own}
        offered = {j: _offered(subtree, homed.index(j)) for j in own}
        orders = _cheapest(own, dict(spare), offered)
        asked = {j: min(CANDIDATES, number) for j, number in spare.items()}
        lacking = sum(max(0, share - n) for share, n in zip(uneven.shares, counts, strict=True))
        complete = len(orders) >= min(sum(asked.values()), lacking) and all(
            len({each.agent for each in offered[j]}) >= asked[j] for j in own
        )
        wait_s = COLLECTED_S + COLLECTED_LATENCIES * view.timing.latency_s + self._round_s
        if orders and (complete or view.now_s - self._uneven_s > wait_s):
            self._issue(view, orders, counts)

    def _issue(self, view: View, orders: list[Order], counts: Sequence[int]) -> None:
        self._order = max(self._order + 1, version_at(view.now_s))
        self._orders, self._ordered_s, self._uneven_s = tuple(orders), view.now_s, None
        gained = Counter(order.to for order in orders)
        gained.subtract(order.queue for order in orders)
        self._expected = tuple([(n, n + gained[j]) for j, n in enumerate(counts)])


def _unevenness(view: View, population: Population, blocked: frozenset[Place]) -> Unevenness:
    """Return what is to be ordered; nothing where the direct rule gives the queues."""
    vacant = [v for v in view.map.led(population.total, blocked) if population.holders[v] == 0]
    shares = view.map.members(population.total, blocked)
    if not vacant and _all_hear_all(view, population):
        return Unevenness(shares, {})
    shares = view.map.with_vacancies(shares, population.members, vacant)
    return Unevenness(shares, transfers(view.map, population.members, shares))


def _all_hear_all(view: View, population: Population) -> bool:
    """Whether the whole team hears the whole team, so that the direct rule gives the queues."""
    return len(view.heard) + 1 == population.total and all(
        h.standing is not None and h.standing.heard >= population.total for h in view.heard
    )


def _offered(subtree: Subtree, index: int) -> Sequence[Candidate]:
    return subtree.candidates[index] if index < len(subtree.candidates) else ()


def _cheapest(
    given: dict[int, list[int]], spare: dict[int, int], offered: dict[int, Sequence[Candidate]]
) -> list[Order]:
    """Return orders for the candidates with the least extra way, as many as are to move."""
    left = {j: list(takers) for j, takers in given.items()}
    shared = len({id(takers) for takers in given.values()}) == 1
    if shared:
        first = next(iter(left.values()))
        left = dict.fromkeys(left, first)
    ranked = sorted((each, j) for j, candidates in offered.items() for each in candidates)
    orders: list[Order] = []
    for (_, agent, to), j in ranked:
        known = any(order.agent == agent for order in orders)
        if known or spare[j] < 1 or not 0 <= to < len(left[j]) or left[j][to] < 1:
            continue
        spare[j] -= 1
        left[j][to] -= 1
        orders.append(Order(agent, j, to))
    return orders[:MAX_ORDERS]
