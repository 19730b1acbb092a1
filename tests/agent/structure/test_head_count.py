"""Counting the team: what an agent knows of it by labels, and the order along its queue."""

from copy import copy

from agent.messages import Summary
from agent.structure.claim import Claim
from agent.structure.head_count import HeadCount
from tests.agent.structure.builders import LINE, heard, view

IDS = 6


def member(own_id, x_m):
    """Return an agent of a line that has just joined its queue: its head count and its claim."""
    claim = Claim(0.0)
    claim.give_up(0, 0.0)
    made = HeadCount(own_id, LINE, IDS)
    made.note_own(view(LINE, 1.0, at=(x_m, 0.0, 0.0)), claim)
    return made, claim


def test_all_find_the_same_order_along_the_queue_by_what_they_tell_each_other():
    at = {1: -4.0, 2: -0.5, 3: -2.2, 4: -9.0}
    team = {k: member(k, x_m)[0] for k, x_m in at.items()}
    for _ in range(2):
        for teller in team.values():
            first, labels = teller.census.wire(1.0)
            told = Summary(mission=0, first=first, labels=labels, news=(), trees=())
            for other in team.values():
                other.census.merge(told, 1.0, 1.0, sender=1)
    for each in team.values():
        assert each.order(view(LINE, 1.1), 0) == [2, 3, 1, 4]


def test_an_agent_keeps_its_code_as_long_as_it_keeps_its_queue():
    made, claim = member(1, -1.0)
    code = made.code
    made.note_own(view(LINE, 5.0, at=(-6.0, 0.0, 0.0)), claim)
    assert made.code == code
    claim.lead(0, 0.0, 6.0)
    made.note_own(view(LINE, 6.0), claim)
    assert made.code != code


def test_a_member_that_nobody_left_hears_is_not_waited_for():
    made, _ = member(1, -1.0)
    made.census.hear(2, 1.0, made.code)
    made.census.hear(3, 1.0, made.code)
    others = [heard(2, heard=2)]
    seen = view(LINE, 1.0, others)
    lost_s = 1.0 + seen.timing.lost_s + seen.timing.answer_s / 2.0 + 0.3
    made.census.hear(1, lost_s, made.code)
    made.census.hear(2, lost_s, made.code)
    late = view(LINE, lost_s, others)
    late.timing = copy(seen.timing)
    late.timing.answer_s = 2.0
    assert made.population(late, 2, all_hear_the_same=True).total == 2
    assert made.population(late, 2, all_hear_the_same=False).total == 3
    assert made.population(late, 1, all_hear_the_same=True).total == 3, "somebody may be heard yet"
