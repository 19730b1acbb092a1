"""What an agent tells as news: as often as loss asks for, and once where others tell it as well."""

from random import Random
from statistics import mean

from agent.messages import Summary
from agent.structure.census import Census
from agent.structure.label_code import FIRST_QUEUE
from agent.structure.label_news import OWN, LabelNews

TELLINGS = 4


def news(*events, source=OWN, enough=TELLINGS):
    made = LabelNews()
    made.enough = enough
    for member in events:
        made.add_event(member, source)
    return made


def taken(known, frames):
    return [known.take(48) for _ in range(frames)]


def test_an_event_is_told_until_it_was_told_often_enough():
    assert taken(news(3), 6) == [[3]] * TELLINGS + [[]] * 2


def test_without_loss_an_event_is_told_once():
    assert taken(news(3, 5, enough=1), 2) == [[3, 5], []]


def test_a_question_is_told_once():
    known = news()
    known.add(3)
    assert taken(known, 2) == [[3], []]


def test_tellings_of_neighbours_count_but_not_those_of_the_source():
    known = news(3, source=7)
    for sender in (7, 7, 7, 8, 9):
        known.hear(3, sender)
    assert taken(known, 4) == [[3], [3], [], []]


def test_an_event_is_told_once_however_many_tell_it_before():
    known = news(3)
    for sender in range(10, 20):
        known.hear(3, sender)
    assert taken(known, 2) == [[3], []]


def test_a_new_event_of_a_member_is_told_from_the_start():
    known = news(3)
    taken(known, 3)
    known.add_event(3, OWN)
    assert taken(known, 5) == [[3]] * TELLINGS + [[]]


def test_where_room_is_short_what_is_new_goes_first():
    known = news(1, 2)
    assert known.take(2) == [1, 2]
    known.add_event(9, OWN)
    assert known.take(2) == [1, 9]
    assert known.take(1) == [2]
    assert len(known) == 3


def test_of_what_was_told_as_often_the_lowest_ids_go_first():
    known = news(64, 9, 8, 1)
    known.take(4)
    assert known.take(2) == [1, 8]
    assert known.take(2) == [9, 64]


def test_an_older_code_of_a_member_is_no_telling_of_its_event():
    known = Census(0, 10)
    known.hear(3, 10.25, FIRST_QUEUE + 1)
    for sender in range(4, 9):
        stale = Census(sender, 10)
        stale.hear(3, 10.0, FIRST_QUEUE)
        known.merge(Summary(0, 0, b"", stale.news(10.25), ()), 10.25, 10.25, sender)
    told = [known.news(10.25, tellings=TELLINGS) for _ in range(TELLINGS)]
    assert [[member for member, _ in frame] for frame in told] == [[3]] * TELLINGS


def spread(agents, reach, tellings, *, loss=0.5, frames=60, seed=0):
    """Spread one event along a row of agents that hear each other within a reach.

    Returns how many know it after some frames, and how often each told it on average.
    """
    random = Random(seed)
    members = [Census(k, agents) for k in range(agents)]
    members[0].hear(0, 10.0, FIRST_QUEUE)
    told = 0
    for _ in range(frames):
        spoken = [each.news(10.0, tellings=tellings) for each in members]
        told += sum(map(len, spoken))
        for to, member in enumerate(members):
            for sender in range(max(0, to - reach), min(agents, to + reach + 1)):
                if sender != to and random.random() >= loss:
                    member.merge(Summary(0, 0, b"", spoken[sender], ()), 10.0, 10.0, sender)
    return sum(each.population(10.0, 1.0, 1, 1).total > 0 for each in members), told / agents


def test_news_reach_the_end_of_a_line_only_if_they_are_repeated():
    """Each hears two on either side; of 30 agents hardly 7 know what was told once."""
    repeated = [known for known, _ in (spread(30, 2, TELLINGS, seed=seed) for seed in range(20))]
    once = [known for known, _ in (spread(30, 2, 1, seed=seed) for seed in range(20))]
    assert mean(repeated) > 29
    assert mean(once) < 10


def test_in_a_dense_team_each_tells_news_hardly_more_than_once():
    known, told = zip(*[spread(30, 12, TELLINGS, seed=seed) for seed in range(20)], strict=True)
    assert mean(known) == 30
    assert mean(told) < 1.3
