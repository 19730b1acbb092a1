"""Numbers in a queue: conflicts end, pushes run to the tail, gaps close inwards."""

from collections import Counter
from random import Random

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from agent.messages import ZERO, Swap
from agent.structure.claim import Claim
from agent.structure.numbers import CONFLICT_M, Numbers
from tests.agent.structure.builders import LINE, heard, leader_summary, view

TICK_S = 0.1


class Ranked:
    """An agent of the only queue that does nothing but keep up its number."""

    def __init__(self, own_id, away_m, number=0, cost_m=1.0):
        self.id, self.at = own_id, (-float(away_m), 0.0, 0.0)
        self.claim = Claim(-20.0)
        self.claim.queue = 0
        self.numbers = Numbers(own_id, -20.0)
        if number:
            self.claim.take(0, number, cost_m, -20.0)

    def decide(self, seen):
        if self.claim.number < 1:
            self.numbers.take_first(seen, self.claim)
        else:
            self.numbers.keep_up(seen, self.claim)

    def said(self, now_s):
        claim = self.claim
        place = LINE.place(0, claim.number) if claim.number else None
        return heard(self.id, self.at, place, cost_m=claim.cost_m, pushes=claim.pushes(now_s))


class Queue:
    """The members of one queue; those within reach_m hear each other. counted: by the leader."""

    def __init__(self, members, *, reach_m=100.0, counted=None, loss=0.0, seed=0, blocked=()):
        self.members, self._reach_m = members, reach_m
        self._counted, self._loss, self._random = counted, loss, Random(seed)
        self._blocked = blocked
        self._known = {}
        self.now_s = 0.0

    def step(self):
        said = [each.said(self.now_s) for each in self.members]
        for each in self.members:
            for other in said:
                near = abs(other.position[0] - each.at[0]) <= self._reach_m
                if other.id != each.id and near and self._random.random() >= self._loss:
                    self._known[(each.id, other.id)] = other
        present = {each.id for each in self.members}
        for each in self.members:
            others = [
                other
                for (to, sender), other in self._known.items()
                if to == each.id and sender in present
            ]
            each.decide(self.view(each, others))
        self.now_s += TICK_S

    def view(self, each, others):
        count = self._counted if self._counted is not None else len(self.members)
        top = max(each.claim.number for each in self.members)
        told = leader_summary(
            total=count + 1, counts=(count,), highest=(top,), histogram=b"\x01" * 16
        )
        return view(LINE, self.now_s, others, at=each.at, summaries=[told], blocked=self._blocked)

    def run(self, seconds):
        for _ in range(round(seconds / TICK_S)):
            self.step()
        return [each.claim.number for each in self.members]


def test_where_all_hear_all_the_first_numbers_are_those_of_the_distances():
    members = [Ranked(own_id, away) for own_id, away in ((1, 5.0), (2, 2.0), (3, 9.0), (4, 2.5))]
    queue = Queue(members)
    for each in members:
        each.numbers = Numbers(each.id, -1.0)
    assert queue.run(0.1) == [3, 1, 4, 2]


def test_who_stands_in_a_place_takes_its_number_though_it_hears_only_some():
    members = [Ranked(k, float(k)) for k in range(1, 10)]
    queue = Queue(members, reach_m=1.0)
    for each in members:
        each.numbers = Numbers(each.id, -1.0)
    assert queue.run(0.1) == list(range(1, 10))


@settings(derandomize=True, deadline=None, max_examples=40)
@given(st.lists(st.integers(1, 8), min_size=1, max_size=8), st.integers(0, 999))
def test_any_numbers_become_those_from_1_to_the_count(numbers, seed):
    """Numbers begin with gaps or twice; all hear all, and one beacon in three is lost."""
    members = [
        Ranked(k, Random(seed + k).uniform(0.5, 8.0), number, cost_m=float(k))
        for k, number in enumerate(numbers)
    ]
    queue = Queue(members, loss=0.3, seed=seed)
    assert sorted(queue.run(25.0)) == list(range(1, len(numbers) + 1))
    kept = [each.claim.number for each in members]
    assert queue.run(5.0) == kept, "and stay"


@settings(derandomize=True, deadline=None, max_examples=15)
@given(st.integers(2, 10), st.integers(0, 999), st.sampled_from([0.0, 0.3]))
def test_neighbours_alone_resolve_conflicts_all_along_a_queue(count, seed, loss):
    """Who hears only those beside it pushes on, up to the tail, until nobody shares a number."""
    random = Random(seed)
    members = [
        Ranked(k, float(number), number, random.uniform(0.1, 3.0))
        for k, number in enumerate(random.choices(range(1, count + 1), k=count))
    ]
    queue = Queue(members, reach_m=2.5, loss=loss, seed=seed)
    for each in members:
        each.at = (-float(each.claim.number), 0.0, 0.0)
    for _ in range(600):
        queue.step()
        for each in members:
            step_m = each.claim.number + each.at[0]
            each.at = (each.at[0] - max(-0.05, min(0.05, step_m)), 0.0, 0.0)
    assert max(Counter(each.claim.number for each in members).values()) == 1


def pair(cost_m, other_cost_m, **fields):
    """Let agent 2 meet agent 5 with its own number; return the number it then has."""
    each = Ranked(2, 3.0, 3, cost_m)
    other = heard(5, (-3.0, 0.0, 0.0), LINE.place(0, 3), cost_m=other_cost_m, **fields)
    far = [heard(k, (-float(k), 0.0, 0.0), LINE.place(0, k)) for k in (6, 7)]
    told = leader_summary(total=9, counts=(8,), highest=(8,))
    each.decide(view(LINE, 0.0, [other, *far], at=each.at, summaries=[told]))
    return each


def test_the_claim_from_nearer_keeps_the_number():
    assert pair(1.0, 2.0).claim.number == 3
    assert pair(2.0, 1.0).claim.number == 4


def test_of_equal_claims_the_lower_id_keeps_the_number():
    assert pair(1.0, 1.0 - 0.9 * CONFLICT_M).claim.number == 3


def test_a_push_comes_first_and_the_loser_pushes_on():
    each = pair(0.1, 9.0, pushes=True)
    assert each.claim.number == 4
    assert each.claim.pushes(0.0)
    assert not each.claim.pushes(5.0)


def test_who_keeps_a_place_for_its_partner_is_no_rival():
    kept = Swap(2, LINE.place(0, 4), LINE.place(0, 3))
    assert pair(2.0, 1.0, reservation=kept).claim.number == 3


def test_a_number_kept_for_a_partner_is_no_gap():
    each = Ranked(2, 3.0, 3)
    kept = Swap(9, LINE.place(0, 2), LINE.place(0, 5))
    others = [
        heard(1, (-1.0, 0.0, 0.0), LINE.place(0, 1)),
        heard(4, (-5.0, 0.0, 0.0), LINE.place(0, 5), reservation=kept),
    ]
    told = leader_summary(total=4, counts=(3,), highest=(5,))
    for tick in range(40):
        each.decide(view(LINE, TICK_S * tick, others, at=each.at, summaries=[told]))
    assert each.claim.number == 3


@pytest.mark.parametrize("reach_m", [100.0, 2.5])
def test_a_gap_closes_from_the_tail_inwards(reach_m):
    members = [Ranked(k, float(k), k) for k in range(1, 8) if k not in (3, 5)]
    queue = Queue(members, reach_m=reach_m)
    for _ in range(300):
        queue.step()
        for each in members:
            step_m = each.claim.number + each.at[0]
            each.at = (each.at[0] - max(-0.05, min(0.05, step_m)), 0.0, 0.0)
    assert [each.claim.number for each in members] == [1, 2, 3, 4, 5]


def test_a_number_taken_by_a_body_is_left_and_skipped():
    blocked = [LINE.place(0, 2), LINE.place(0, 4)]
    members = [Ranked(k, float(k), k) for k in range(1, 5)]
    assert sorted(Queue(members, blocked=blocked).run(15.0)) == [1, 3, 5, 6]


def test_the_first_numbers_follow_the_order_that_all_know():
    """Each hears nobody, and still all take different numbers."""
    order = [7, 2, 9, 4]
    told = leader_summary(total=5, counts=(4,), highest=(0,), histogram=b"\x01" * 16)
    for number, own_id in enumerate(order, 1):
        each = Ranked(own_id, 3.0)
        each.numbers = Numbers(own_id, -1.0)
        seen = view(LINE, 0.0, at=each.at, summaries=[told])
        seen.order = order
        each.decide(seen)
        assert each.claim.number == number


def test_an_agent_that_knows_of_fewer_members_than_the_leader_waits_but_not_for_ever():
    each = Ranked(2, 3.5)
    each.numbers = Numbers(2, -1.0)
    told = leader_summary(total=5, counts=(4,), highest=(0,), histogram=b"\x01" * 16)
    for tick in range(30):
        seen = view(LINE, TICK_S * tick, at=each.at, summaries=[told])
        seen.order = [7, 2]
        each.decide(seen)
        assert (each.claim.number > 0) == (TICK_S * tick >= seen.timing.resettle_s - 1e-9)


def test_who_led_for_a_moment_before_the_others_had_numbers_does_not_push():
    each = Ranked(2, 3.0)
    each.numbers = Numbers(2, -1.0)
    each.claim.lead(0, 3.0, -0.5)
    each.claim.give_up(0, -0.4)
    told = leader_summary(total=3, counts=(2,), highest=(0,))
    seen = view(LINE, 0.0, at=each.at, summaries=[told])
    seen.order = [5, 2]
    each.decide(seen)
    assert (each.claim.number, each.claim.pushes(0.1)) == (2, False)


def test_nobody_takes_a_number_before_the_leader_says_go():
    each = Ranked(2, 3.0)
    each.numbers = Numbers(2, -1.0)
    for told in (None, leader_summary(total=2, counts=(1,), highest=(0,), go=False)):
        each.decide(view(LINE, 0.0, at=each.at, summaries=[told]))
        assert each.claim.number == 0
    told = leader_summary(total=2, counts=(1,), highest=(0,))
    each.decide(view(LINE, 0.0, at=each.at, summaries=[told]))
    assert each.claim.number == 1


@settings(derandomize=True, deadline=None, max_examples=100)
@given(
    st.lists(st.tuples(st.integers(-1, 3), st.integers(-1, 2**15 - 1)), max_size=4),
    st.integers(0, 2**16 - 1),
    st.integers(0, 2**16 - 1),
    st.binary(max_size=64),
    st.integers(0, 3),
)
def test_invented_claims_and_counts_leave_a_number_that_there_is(claims, count, top, bins, number):
    each = Ranked(2, 3.0, number)
    others = [heard(k + 3, ZERO, place) for k, place in enumerate(claims)]
    told = leader_summary(total=9, counts=(count,), highest=(top,), histogram=bins)
    for tick in range(12):
        each.decide(view(LINE, TICK_S * tick, others, at=each.at, summaries=[told]))
    assert each.claim.number >= 0
    assert each.claim.cost_m < 1e6


@pytest.mark.parametrize("number", [2, 3])
def test_who_stands_behind_a_blocked_place_takes_the_number_of_the_place_it_stands_in(number):
    at = (-float(number), 0.0, 0.0)
    member, other = Ranked(5, number), heard(6, (at[0] - 1.0, 0.0, 0.0))
    member.numbers = Numbers(5, -1.0)
    told = leader_summary(total=6, counts=(5,), histogram=b"\x01" * 16)
    blocked = [LINE.place(0, 1)]
    member.decide(view(LINE, 0.5, [other], at=at, summaries=[told], blocked=blocked))
    assert member.claim.number == number


def test_who_takes_its_number_anew_waits_again_until_it_knows_of_as_many_as_the_leader():
    member = Ranked(5, 30.3)
    member.numbers = Numbers(5, -1.0)

    def decide(now_s, count):
        told = leader_summary(total=count + 1, counts=(count,), histogram=b"\x01" * 16)
        seen = view(LINE, now_s, [heard(6, ZERO)], at=member.at, summaries=[told])
        seen.order = [5, 6]
        member.decide(seen)
        return member.claim.number

    assert [decide(0.5, 3), decide(0.6, 2)] == [0, 1]
    assert [decide(2.5, 9), decide(2.6, 9)] == [0, 0]
    assert decide(4.0, 9) > 0, "the agent takes no place after 4 s"


@pytest.mark.parametrize(("total", "number"), [(None, 3), (3, 2)], ids=["under way", "counted"])
def test_a_gap_stays_while_its_member_may_lack_the_mission(total, number):
    """No steady count has been heard, and the team is the one of the mission before."""
    each = Ranked(4, 3.0, 3)
    told = leader_summary(total=total, counts=(total - 1,), highest=(3,)) if total else None
    for tick in range(40):
        others = [heard(1, (-1.0, 0.0, 0.0), LINE.place(0, 1))]
        seen = view(LINE, TICK_S * tick, others, at=each.at, summaries=[told])
        seen.expected = 4
        each.decide(seen)
    assert each.claim.number == number
