"""A leader says go when the counts are steady, and orders no more than there is too much."""

from itertools import pairwise

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from agent.controller import Link
from agent.messages import ZERO, Candidate, RootKey
from agent.structure.census import Population
from agent.structure.leader import EXPECTED_S, FOLLOWED_S, MAX_ORDERS, Leader
from tests.agent.structure.builders import TWO, heard, lines, rays, subtree, view

KEY = RootKey(10, 1)
ROUND_S = 0.5
TICK_S = 0.1
THREE = rays((-1.0, 1.0, 0.0), (-1.0, -1.0, 0.0), (-1.0, 0.0, 1.0))
HOMES = lines(ZERO, (0.0, 5.0, 0.0))


def population(*members, holders=(1,)):
    return Population(sum(members) + sum(holders), members, holders)


def offers(formation, counts, each=8, vertex=0):
    """Return a subtree in which every queue offers some members to every other queue."""
    found, agent = [], 100
    for queue in formation.homed[vertex]:
        kept = []
        for k in range(min(each, counts[queue])):
            others = [j for j in range(formation.queues) if j != queue]
            kept += [Candidate(10 * k + to, agent, to) for to in others]
            agent += 1
        found.append(tuple(sorted(kept)[:8]))
    none = (0,) * len(found)
    return subtree(highest=none, candidates=tuple(found), histogram=bytes(16))


class Flight:
    """A leader, asked ten times a second."""

    def __init__(self, formation, vertex=0, link=None, neighbours=(), expected=0):
        self._formation, self._link, self._neighbours = formation, link, neighbours
        self._leader = Leader(vertex, KEY, 0.0, ROUND_S, expected)
        self._vertex, self.now_s = vertex, 0.0
        self._first = True

    def ask(self, counted, offered=None, blocked=()):
        self.now_s += TICK_S
        if self._first:
            self._first, counted = False, counted._replace(changed_s=self.now_s)
        seen = view(self._formation, self.now_s, self._neighbours, link=self._link, blocked=blocked)
        if offered is None:
            offered = offers(self._formation, counted.members, vertex=self._vertex)
        return self._leader.summary(seen, counted, offered, frozenset(blocked))

    def until_orders(self, counted, seconds=10.0, offered=None, blocked=()):
        for _ in range(round(seconds / TICK_S)):
            found = self.ask(counted, offered, blocked)
            if found.orders:
                break
        return found.orders


def test_go_comes_when_the_counts_have_been_steady():
    flight = Flight(TWO, neighbours=[heard(k) for k in range(2, 4)])
    for k in range(20):
        assert not flight.ask(population(k % 3, 2)).go
    found = [flight.ask(population(2, 2)).go for _ in range(10)]
    assert found == sorted(found)
    assert found[-1]
    assert flight.ask(population(0, 1)).go, "once gone, always gone"


def test_a_count_below_the_members_heard_is_not_steady():
    flight = Flight(TWO, neighbours=[heard(k) for k in range(2, 7)])
    assert not any(flight.ask(population(1, 1)).go for _ in range(50))
    assert any(flight.ask(population(3, 2)).go for _ in range(50))


def test_a_slow_radio_takes_longer_to_be_steady():
    def wait_s(link):
        flight = Flight(TWO, link=link)
        while not flight.ask(population(2, 2)).go:
            assert flight.now_s < 10.0
        return flight.now_s

    assert wait_s(Link(0.0, 0.0, 9.0)) < wait_s(Link(0.5, 0.2, 9.0))


def test_a_summary_says_what_was_counted_of_the_own_queues():
    flight = Flight(HOMES, vertex=1)
    found = flight.ask(population(3, 5, holders=(1, 1)))
    assert (found.root, found.total, found.counts) == (KEY, 10, (5,))
    versions = [flight.ask(population(3, 5, holders=(1, 1))).version for _ in range(5)]
    assert all(b > a for a, b in pairwise(versions))


def test_even_queues_get_no_orders():
    assert Flight(TWO).until_orders(population(4, 4)) == ()
    assert Flight(TWO).until_orders(population(4, 3)) == ()


@settings(derandomize=True, deadline=None, max_examples=60)
@given(st.lists(st.integers(0, 14), min_size=3, max_size=3), st.integers(0, 8))
def test_orders_never_exceed_what_a_queue_has_too_much(counts, each):
    counted = population(*counts)
    shares = THREE.members(counted.total)
    offered = offers(THREE, counts, each)
    orders = Flight(THREE).until_orders(counted, offered=offered)
    assert len(orders) <= MAX_ORDERS
    assert len({order.agent for order in orders}) == len(orders), "one order an agent"
    moved = [*counts]
    for order in orders:
        moved[order.queue] -= 1
        moved[order.to] += 1
    for count, after, share in zip(counts, moved, shares, strict=True):
        assert min(count, share) <= after <= max(count, share)
    if each == 8 and max(c - s for c, s in zip(counts, shares, strict=True)) in (1, 2, 3):
        assert moved == list(shares), "a few are not all moved at once"


def test_the_least_extra_way_is_ordered():
    offered = subtree(
        highest=(3, 1),
        candidates=((Candidate(-5, 8, 1), Candidate(3, 7, 1), Candidate(9, 6, 1)), ()),
    )
    assert [o.agent for o in Flight(TWO).until_orders(population(3, 1), offered=offered)] == [8]


@pytest.mark.parametrize("follow_after_s", [0.3, 1.5])
def test_no_new_order_until_the_counts_have_followed(follow_after_s):
    flight = Flight(TWO)
    first = flight.until_orders(population(5, 1))
    number = flight.ask(population(5, 1)).order
    assert len(first) == 2
    for _ in range(round(follow_after_s / TICK_S)):
        found = flight.ask(population(5, 1))
        assert (found.order, found.orders) == (number, first)
    assert flight.ask(population(4, 2)).orders == first, "half of it is not all"
    assert flight.ask(population(3, 3)).orders == ()
    assert flight.until_orders(population(3, 3)) == ()


def test_orders_that_nobody_follows_are_given_anew():
    flight = Flight(TWO)
    first = flight.until_orders(population(5, 1))
    number, since_s = flight.ask(population(5, 1)).order, flight.now_s
    while (found := flight.ask(population(5, 1))).order == number:
        assert flight.now_s < since_s + FOLLOWED_S + 4.0 * ROUND_S
    assert flight.now_s > since_s + FOLLOWED_S
    assert found.order > number
    assert found.orders == first


def test_go_waits_until_the_first_orders_have_been_followed():
    flight = Flight(TWO)
    assert len(flight.until_orders(population(5, 1))) == 2
    assert not flight.ask(population(5, 1)).go
    assert not flight.ask(population(4, 2)).go
    assert flight.ask(population(3, 3)).go


def test_members_that_turn_up_meanwhile_do_not_hide_that_orders_were_followed():
    flight = Flight(THREE)
    assert len(flight.until_orders(population(5, 1, 2))) == 2
    assert flight.ask(population(5, 3, 3)).orders, "not yet: nobody has left the first queue"
    found = flight.ask(population(3, 3, 3))
    assert (found.orders, found.go) == ((), True)


def test_orders_that_leave_the_queues_uneven_are_followed_by_others_before_go():
    flight = Flight(TWO)
    flight.until_orders(population(5, 1))
    assert not flight.ask(population(3, 7)).go
    assert flight.until_orders(population(3, 7))
    assert not flight.ask(population(3, 7)).go
    assert flight.ask(population(5, 5)).go


def test_go_comes_without_candidates_too():
    flight = Flight(TWO)
    nobody = offers(TWO, (0, 0))
    while not flight.ask(population(5, 1), nobody).go:
        assert flight.now_s < 3.0


def test_as_many_are_ordered_at_once_as_offer_themselves_in_time():
    counts = (7, 1)
    flight = Flight(TWO, neighbours=[heard(k) for k in range(2, 8)])
    few = offers(TWO, counts, 2)
    assert not any(flight.ask(population(*counts), few).orders for _ in range(9))
    assert len(flight.until_orders(population(*counts), 0.1)) == 3


def test_where_all_hear_all_the_direct_rule_gives_the_queues_and_not_the_leader():
    around = [heard(k, heard=7) for k in range(2, 8)]
    assert Flight(TWO, neighbours=around).until_orders(population(5, 1)) == ()
    one_hears_less = [*around[1:], heard(2, heard=6)]
    assert len(Flight(TWO, neighbours=one_hears_less).until_orders(population(5, 1))) == 2


def test_no_order_while_the_counts_change():
    flight = Flight(TWO)
    for k in range(100):
        assert flight.ask(population(5 + k // 3 % 2, 1)).orders == ()
    while not flight.ask(population(3, 3)).go:
        assert flight.now_s < 15.0
    for k in range(100):
        assert flight.ask(population(5 + k // 9 % 2, 1)).orders == ()


def test_who_leads_orders_only_members_of_its_own_queues():
    counted = population(6, 2, holders=(1, 1))
    assert Flight(HOMES, vertex=1).until_orders(counted) == ()
    orders = Flight(HOMES, vertex=0).until_orders(counted)
    assert {(order.queue, order.to) for order in orders} == {(0, 1)}
    assert len(orders) == 2


def test_an_agent_is_ordered_to_a_vertex_that_nobody_will_stand_for():
    """Its share besides the vertex is none; one more is too much nowhere else."""
    counted = population(2, 0, holders=(1, 0))
    assert HOMES.members(counted.total) == (1, 0)
    orders = Flight(HOMES).until_orders(counted)
    assert [(order.queue, order.to) for order in orders] == [(0, 1)]
    stands = population(1, 1, holders=(1, 0))
    assert Flight(HOMES).until_orders(stands) == (), "a member of the queue will stand for it"


def test_a_blocked_place_changes_the_shares_and_is_told():
    blocked = [TWO.vertex_places[0]]
    flight = Flight(TWO)
    assert flight.until_orders(population(3, 2, holders=(0,)), blocked=blocked) == ()
    assert flight.ask(population(3, 2, holders=(0,)), blocked=blocked).blocked == ((0, 0),)


def test_a_leader_waits_for_those_of_the_mission_before_but_not_for_ever():
    """Orders before they have the mission would move others to places that they will take."""
    flight, few, all_are_there = Flight(TWO, expected=7), population(4, 1), population(3, 3)
    seen = [flight.ask(few) for _ in range(round((EXPECTED_S - 0.5) / TICK_S))]
    assert not any(each.go or each.orders for each in seen)
    late = [flight.ask(few) for _ in range(round(2.0 / TICK_S))]
    assert late[-1].orders, "the leader still waits for members after EXPECTED_S"
    soon = Flight(TWO, expected=7)
    assert not soon.ask(few).go
    assert any(soon.ask(all_are_there).go for _ in range(round(2.0 / TICK_S)))
