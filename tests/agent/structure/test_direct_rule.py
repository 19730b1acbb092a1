"""The direct rule is the team's: it holds only where every member hears every member."""

from copy import copy

import pytest

from agent.messages import Place
from agent.structure.claim import Claim
from agent.structure.direct_rule import ENTER_S, LEAVE_S, DirectRule
from tests.agent.structure.builders import LINE, TWO, heard, leader_summary, lines, view

TICK_S = 0.1
TEAM = 4
APEX, APEX_POINT = Place(0, 0), (0.0, 0.0, 0.0)


def told(total=TEAM, **fields):
    return leader_summary(total=total, counts=(total - 1,), **fields)


def neighbours(*counts, leader=True):
    """Return neighbours that hear so many members each; the first one leads."""
    found = []
    for k, count in enumerate(counts):
        at = (-float(k), 0.0, 0.0)
        if k == 0 and leader:
            found.append(heard(k + 1, at, APEX, heard=count, leads=0))
        else:
            found.append(heard(k + 1, at, LINE.place(0, k or 1), heard=count))
    return found


class Flight:
    """An agent that asks its rule ten times a second."""

    def __init__(self, formation=LINE, ranked=True):
        self.formation, self.now_s = formation, 0.0
        self.claim = Claim(-9.0)
        if ranked:
            self.claim.take(0, 3, 0.0, -9.0)
        self.rule = DirectRule(9, 0.0)

    def run(self, seconds, others, summaries=None):
        for _ in range(round(seconds / TICK_S)):
            self.now_s += TICK_S
            summaries = summaries or [told()]
            seen = view(
                self.formation, self.now_s, others, at=(-9.0, 0.0, 0.0), summaries=summaries
            )
            self.rule.update(seen, self.claim)
            if self.rule.applies:
                self.rule.choose(seen, self.claim)
        return self.rule.applies


def test_it_holds_where_all_hear_all():
    flight = Flight()
    assert not flight.run(ENTER_S - TICK_S, neighbours(4, 4, 4))
    assert flight.run(0.5, neighbours(4, 4, 4))
    assert flight.rule.heard == TEAM


@pytest.mark.parametrize("counts", [(4, 4), (4, 4, 3), (4, 4, 4, 4)])
def test_it_does_not_hold_where_a_member_is_not_heard_by_any_or_not_counted(counts):
    assert not Flight().run(5.0, neighbours(*counts))


def test_it_does_not_hold_before_the_team_is_counted():
    assert not Flight().run(5.0, neighbours(4, 4, 4), [told(go=False)])


def test_it_ends_for_all_when_a_member_hears_fewer_for_long():
    flight = Flight()
    flight.run(1.0, neighbours(4, 4, 4))
    assert flight.run(LEAVE_S, neighbours(4, 3, 4)), "a lost beacon or two end nothing"
    assert flight.run(1.0, neighbours(4, 4, 4))
    assert not flight.run(LEAVE_S + 2.0 * TICK_S, neighbours(4, 3, 4))


def test_it_ends_while_a_vertex_has_no_leader():
    """Else nobody is ordered to a vertex that nobody started near."""
    pair = lines((0.0, 0.0, 0.0), (0.0, 3.0, 0.0))
    other = leader_summary(total=TEAM, counts=(0,))
    flight = Flight(pair)
    assert flight.run(1.0, neighbours(4, 4, 4), [told(), other])
    lost_s = 1.5
    assert flight.run(LEAVE_S + lost_s - TICK_S, neighbours(4, 4, 4), [told(), None])
    assert not flight.run(3.0 * TICK_S, neighbours(4, 4, 4), [told(), None])


def test_no_swap_under_way_is_cut_short():
    flight = Flight()
    flight.claim.proposal = object()
    assert not flight.run(3.0, neighbours(4, 4, 4))


def test_each_takes_another_place_of_the_layout_and_the_leader_keeps_its_own():
    """All four compute the assignment of the same team, each from its own side."""
    at = {1: (0.0, 0.0, 0.0), 2: (-3.0, 0.2, 0.0), 3: (-1.0, 0.1, 0.0), 4: (-2.0, 0.0, 0.0)}
    chosen = {}
    for own in (2, 3, 4):
        others = [heard(1, at[1], APEX, heard=4, leads=0)]
        others += [heard(k, at[k], None, heard=4) for k in (2, 3, 4) if k != own]
        claim, rule = Claim(-9.0), DirectRule(own, 0.0)
        for tick in range(12):
            seen = view(LINE, TICK_S * tick, others, at=at[own], summaries=[told()])
            rule.update(seen, claim)
            if rule.applies:
                rule.choose(seen, claim)
        chosen[own] = claim.number
    assert chosen == {2: 3, 3: 1, 4: 2}


def test_the_assignment_names_one_successor_of_a_leader():
    numbers = {2: 3, 3: 1, 4: 2}
    at = {k: (-float(number), 0.0, 0.0) for k, number in numbers.items()}
    named = []
    for own, number in numbers.items():
        others = [heard(k, at[k], LINE.place(0, numbers[k]), heard=3) for k in at if k != own]
        rule, seen = DirectRule(own, 0.0), view(LINE, 1.0, others, at=at[own], summaries=[None])
        claim = Claim(-9.0)
        claim.take(0, number, 0.0, -9.0)
        rule.update(seen, claim)
        named += [own] * rule.succeeds(seen, claim, 0)
    assert named == [3]


def test_those_left_choose_anew_once_the_others_are_lost_though_the_leader_counts_them_still():
    flight = Flight()
    assert flight.run(1.0, neighbours(4, 4, 4))
    left = neighbours(3, 3, 3)[:2]
    flight.run(1.0, left)
    assert flight.claim.number == 3, "they may be heard again"
    flight.run(1.0, left)
    assert flight.claim.number == 2


def test_those_left_close_up_while_nobody_leads_the_vertex_yet():
    """Its successor is named by the same assignment, so nobody has to wait until it leads."""
    flight = Flight()
    assert flight.run(1.0, neighbours(4, 4, 4))
    left = neighbours(3, 3, 3)[1:]
    flight.run(2.0, left, [None])
    assert (flight.claim.number, flight.claim.leads) == (2, False)


def test_who_is_to_lead_a_vertex_gives_its_number_up_at_once():
    """The assignment gives that number to another one, which takes it now."""
    flight = Flight()
    assert flight.run(1.0, neighbours(4, 4, 4))
    left = [heard(k, (-9.0 - k, 0.0, 0.0), LINE.place(0, k), heard=3) for k in (1, 2)]
    flight.run(2.0, left, [None])
    assert (flight.claim.number, flight.claim.queue, flight.claim.leads) == (0, 0, False)


def test_a_leader_whose_vertex_is_taken_shares_the_queues_with_the_others():
    """It may stand in a place that the layout has not; then the others have one too many."""
    at = {1: (-2.0, -2.0, 0.0), 2: (-1.0, 1.0, 0.0), 3: (-1.2, 1.2, 0.0)}
    claims = {k: Claim(-9.0) for k in at}
    claims[1].lead(0, 0.0, -9.0)
    claims[1].take(1, 2, 0.0, -9.0)
    for k in (2, 3):
        claims[k].take(0, 1, 0.0, -9.0)
    layout = set(TWO.formation.layout(3, frozenset([APEX])).places)
    for deciding in ((2, 3), (1,)):
        chosen = [choice(own, at, claims) for own in deciding]
        for own, number in zip(deciding, chosen, strict=True):
            claims[own].take(*number, 0.0, -9.0)
        places = [TWO.place(claims[k].queue, claims[k].number) for k in deciding]
        assert len({*places}) == len(deciding)
        assert layout.issuperset(places)
    assert {TWO.place(c.queue, c.number) for c in claims.values()} == layout


def test_a_leader_keeps_its_number_until_it_returns_to_a_vertex_that_is_free_again():
    """It looks for a while whether the vertex is free; until then the others keep off."""
    at = {1: (-1.0, -1.0, 0.0), 2: (-1.0, -1.1, 0.0), 3: (-1.2, 1.2, 0.0)}
    claims = {k: Claim(-9.0) for k in at}
    claims[1].lead(0, 0.0, -9.0)
    for k, queue in ((1, 1), (2, 1), (3, 0)):
        claims[k].take(queue, 1, 0.0, -9.0)
    chosen = [choice(own, at, claims, blocked=()) for own in (2, 3)]
    assert (1, 1) not in chosen
    assert len({*chosen}) == len(chosen)


def choice(own, at, claims, blocked=(APEX,)):
    """Return the queue and number that an agent of TWO chooses while nobody else moves."""
    around = [
        heard(k, at[k], TWO.place(c.queue, c.number), heard=3, leads=c.vertex, queue=c.queue)
        for k, c in claims.items()
        if k != own
    ]
    mine, rule, told_all = copy(claims[own]), DirectRule(own, 0.0), [leader_summary(total=3)]
    for tick in range(12):
        seen = view(TWO, TICK_S * tick, around, at=at[own], summaries=told_all, blocked=blocked)
        rule.update(seen, mine)
        if rule.applies:
            rule.choose(seen, mine)
    assert rule.applies
    return mine.queue, mine.number


def test_two_leaders_of_one_vertex_leave_the_places_as_they_are():
    """There are then more places than agents without one; one of the two will make way."""
    flight = Flight(TWO)
    assert flight.run(1.0, neighbours(4, 4, 4))
    before = flight.claim.queue, flight.claim.number
    double = neighbours(4, 4, 4)
    double[1] = heard(2, (0.1, 0.0, 0.0), APEX, heard=4, leads=0)
    flight.run(0.8, double)
    assert (flight.claim.queue, flight.claim.number) == before


def test_an_agent_that_chose_a_queue_which_gathers_without_it_takes_the_place_that_is_left():
    """That queue has its members, so the place is one of another queue."""
    pair = lines((0.0, 0.0, 0.0), (0.0, 3.0, 0.0))
    others = [
        heard(1, (0.0, 0.0, 0.0), APEX, heard=5, leads=0),
        heard(2, (0.0, 3.0, 0.0), Place(1, 0), heard=5, leads=1, queue=1),
        heard(3, (-1.0, 0.0, 0.0), pair.place(0, 1), heard=5),
        heard(4, (-1.0, 3.0, 0.0), pair.place(1, 1), heard=5, queue=1),
    ]
    summaries = [leader_summary(total=5, counts=(1,)), leader_summary(total=5, counts=(2,))]
    claim, rule = Claim(-9.0), DirectRule(9, 0.0)
    claim.give_up(1, 0.0)
    for tick in range(12):
        seen = view(pair, TICK_S * tick, others, at=(-9.0, 0.0, 0.0), summaries=summaries)
        seen.gathering = frozenset([1])
        rule.update(seen, claim)
        if rule.applies:
            rule.choose(seen, claim)
    assert (claim.queue, claim.number) == (0, 2)


def test_it_holds_on_for_an_agent_that_is_alone():
    rule, claim = DirectRule(9, 0.0), Claim(0.0)
    claim.lead(0, 0.0, 0.0)
    applied = []
    for tick in range(60):
        rule.update(view(LINE, TICK_S * tick, summaries=[told(1)]), claim)
        applied.append(rule.applies)
    assert applied[-1]
    assert applied == sorted(applied), "the rule ends though it still holds"


def test_a_guess_does_not_outlast_a_flickering_radio():
    """Every other moment the radio drops one of two; by then both have flown away."""
    rule, first, second = DirectRule(9, 0.0), (-1.0, 0.0, 0.0), (-2.0, 0.0, 0.0)
    for now_s in (0.0, 1.0):
        both = [heard(1, first, heard=3), heard(2, second, heard=3)]
        assert rule.likely(view(LINE, now_s, both)) == (APEX if now_s else None)
    lost_s = view(LINE, 0.0).timing.lost_s
    away = [heard(1, APEX_POINT, heard=2), heard(2, first, heard=2)]
    found = [
        rule.likely(view(LINE, 1.0 + 0.02 * k, away[: 1 + k % 2], at=second))
        for k in range(1, round(2.0 * lost_s / 0.02))
    ]
    assert found[0] == APEX
    assert found[-1] is None
    now_s = 1.0 + 2.0 * lost_s
    assert [rule.likely(view(LINE, now_s + late_s, away, at=second)) for late_s in (0.0, 0.2)] == [
        None,
        Place(0, 2),
    ]
