"""The census: labels merge as a maximum, nobody counts twice, and who is gone does not count."""

from random import Random

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from agent.messages import Summary
from agent.structure.census import (
    ASK_S,
    LAGS,
    MAX_LABELLED,
    MAX_QUANTA,
    NEWS,
    QUANTUM_S,
    SHARED_LABELS,
    UNKNOWN,
    Census,
)
from agent.structure.label_code import FIRST_QUEUE, FIRST_VERTEX, UNPLACED

OWN, IDS = 0, 40
LOST_S, ANSWER_S = 1.5, 0.6
QUEUES, VERTICES = 3, 2
NOW_S = 30.0

members = st.integers(1, IDS - 1)
codes = st.sampled_from([UNPLACED, *range(FIRST_QUEUE, FIRST_QUEUE + QUEUES), FIRST_VERTEX])
labels = st.tuples(members, st.integers(0, 6).map(lambda ago: NOW_S - 0.25 * ago), codes)


def census(*heard, own=OWN, ids=IDS):
    made = Census(own, ids)
    for member, stamp_s, code in heard:
        made.hear(member, stamp_s, code)
    return made


def told(known, now_s=NOW_S, regular=True):
    """Return what an agent passes on of its census."""
    first, run = known.wire(now_s) if regular else (0, b"")
    return Summary(mission=0, first=first, labels=run, news=known.news(now_s), trees=())


def counted(known, now_s=NOW_S):
    """Return the members that are there; a label may be of any age."""
    return known.population(now_s, LOST_S, QUEUES, VERTICES)._replace(changed_s=0.0)


def content(known):
    """Return all labels as they would be sent now."""
    return told(known).labels.ljust(2 * IDS, b"\xff")


@settings(derandomize=True, deadline=None)
@given(st.lists(st.lists(labels, max_size=8), min_size=1, max_size=4), st.randoms())
def test_the_order_of_merging_does_not_matter_nor_does_merging_twice(tellers, random):
    """A label is passed on by news as exactly as it is known, so merging is a maximum."""
    spoken = [told(census(*heard, own=1)) for heard in tellers]
    one, other = census(), census()
    for summary in spoken:
        one.merge(summary, NOW_S, NOW_S, sender=1)
    shuffled = [*spoken, *spoken]
    random.shuffle(shuffled)
    for summary in shuffled:
        other.merge(summary, NOW_S, NOW_S, sender=1)
    assert content(one) == content(other)
    assert counted(one).total == counted(other).total


@settings(derandomize=True, deadline=None)
@given(st.lists(labels, max_size=8), st.lists(labels, max_size=8), st.lists(labels, max_size=8))
def test_merging_is_associative(a, b, c):
    left = census(*a)
    left.merge(told(census(*b, own=1)), NOW_S, NOW_S, sender=1)
    left.merge(told(census(*c, own=2)), NOW_S, NOW_S, sender=1)
    middle = census(*b, own=1)
    middle.merge(told(census(*c, own=2)), NOW_S, NOW_S, sender=1)
    right = census(*a)
    right.merge(told(middle), NOW_S, NOW_S, sender=1)
    assert content(left) == content(right) or {m for m, *_ in (*b, *c)} & {1, 2}


@settings(derandomize=True, deadline=None)
@given(st.lists(labels, max_size=60))
def test_each_member_counts_once_by_its_latest_label(heard):
    known, latest = census(), {}
    for member, stamp_s, code in heard:
        known.hear(member, stamp_s, code)
        known.merge(told(census((member, stamp_s, code), own=39)), NOW_S, NOW_S, sender=1)
        latest[member] = max(latest.get(member, (0.0, 0)), (stamp_s, code))
    found, present = counted(known), [code for _, code in latest.values()]
    assert found.total == len(latest)
    assert found.members == tuple(present.count(FIRST_QUEUE + j) for j in range(QUEUES))
    assert found.holders == tuple(present.count(FIRST_VERTEX + v) for v in range(VERTICES))


@pytest.mark.parametrize("loss", [0.0, 0.5, 0.8])
@pytest.mark.parametrize("seed", range(3))
def test_no_agent_ever_counts_more_than_there_are(seed, loss):
    """Labels go round a ring by any ways, duplicated and late, while members change queues."""
    random, ring = Random(seed), 12
    known = [census(own=each, ids=ring) for each in range(ring)]
    air = []
    for tick in range(400):
        now_s = 0.25 * tick
        for each, mine in enumerate(known):
            mine.hear(each, now_s, FIRST_QUEUE + (each + tick // 50) % QUEUES)
            for near in ((each - 1) % ring, (each + 1) % ring):
                for _ in range(2):
                    if random.random() >= loss:
                        air.append((now_s + 0.5 * random.random(), near, now_s, told(mine, now_s)))
        due = [each for each in air if each[0] <= now_s]
        air = [each for each in air if each[0] > now_s]
        for _, to, stamp_s, summary in due:
            known[to].merge(summary, stamp_s, now_s, sender=1)
        found = [counted(mine, now_s) for mine in known]
        assert max(each.total for each in found) <= ring
        if loss == 0.0 and now_s > 5.0:
            assert min(each.total for each in found) == ring
        assert all(sum(each.members) == each.total for each in found)


def test_who_is_gone_expires_everywhere_and_stays_away():
    """A chain passes on the last label of a member that left; it must not live by being retold."""
    chain = [census(own=each) for each in range(1, 6)]
    gone, left_s = 30, 20.0
    for tick in range(240):
        now_s = 0.25 * tick
        if now_s < left_s:
            chain[0].hear(gone, now_s, FIRST_QUEUE)
        for own, mine in enumerate(chain, start=1):
            mine.hear(own, now_s, FIRST_QUEUE)
        spoken = [told(mine, now_s) for mine in chain]
        for k, mine in enumerate(chain):
            for near in (k - 1, k + 1):
                if 0 <= near < len(chain):
                    mine.merge(spoken[near], now_s, now_s + 0.1, sender=1)
        totals = [counted(mine, now_s).total for mine in chain]
        if 10.0 < now_s < left_s:
            assert totals == [6] * 5
        if now_s > left_s + LOST_S + LAGS * 6 * 0.35 + 1.0:
            assert totals == [5] * 5


def test_a_member_that_was_heard_lately_is_there_and_then_is_not():
    known = census((3, NOW_S, FIRST_QUEUE))
    assert counted(known, NOW_S + LOST_S).total == 1
    assert counted(known, NOW_S + LOST_S + 2.0 * QUANTUM_S + 0.01).total == 0


def test_news_are_the_members_that_changed_their_queue():
    known = census((3, NOW_S, FIRST_QUEUE), (4, NOW_S, FIRST_QUEUE))
    assert known.has_news
    assert [member for member, _ in known.news(NOW_S)] == [3, 4]
    assert not known.has_news
    known.hear(3, NOW_S + 1.0, FIRST_QUEUE)
    assert not known.has_news, "the same queue again"
    known.hear(4, NOW_S + 1.0, FIRST_QUEUE + 1)
    assert [member for member, _ in known.news(NOW_S + 1.0)] == [4]


def test_news_that_do_not_fit_one_frame_follow_in_the_next():
    known = census(*((member, NOW_S, FIRST_QUEUE) for member in range(1, 101)), ids=200)
    found = []
    while known.has_news:
        news = known.news(NOW_S)
        assert len(news) <= NEWS
        found += [member for member, _ in news]
    assert found == list(range(1, 101))


@pytest.mark.parametrize("ids", [1, SHARED_LABELS, SHARED_LABELS + 1, 3 * SHARED_LABELS])
def test_labels_survive_the_wire(ids):
    """The label arrives with its age to a quantum and its code, of any number of ids in turns."""
    random, known = Random(7), Census(OWN, ids)
    for member in range(ids):
        known.hear(member, NOW_S - random.uniform(0.0, LOST_S), random.choice([1, 2, 3, 128, 129]))
    other = Census(ids, ids)
    for _ in range(-(-ids // SHARED_LABELS)):
        first, run = known.wire(NOW_S)
        assert len(run) <= 2 * SHARED_LABELS
        other.merge(Summary(0, first, run, (), ()), NOW_S, NOW_S, sender=1)
    assert counted(other) == counted(known)
    assert counted(other).total == ids


def test_a_label_too_old_for_the_wire_is_unknown():
    known = census((3, NOW_S, FIRST_QUEUE))
    late_s = NOW_S + (MAX_QUANTA + 1) * QUANTUM_S
    assert known.news(late_s) == ((3, UNKNOWN),)
    other = census()
    other.merge(told(known, late_s), late_s, late_s, sender=1)
    assert content(other) == content(census())


def test_others_cannot_speak_for_the_own_agent():
    known = census((OWN, NOW_S - 1.0, FIRST_QUEUE))
    known.merge(told(census((OWN, NOW_S, FIRST_QUEUE + 1), own=1)), NOW_S, NOW_S, sender=1)
    assert counted(known).members == (1, 0, 0)


@settings(derandomize=True, deadline=None)
@given(
    st.integers(0, 2**16 - 1),
    st.binary(max_size=513),
    st.lists(st.tuples(st.integers(0, 2**16 - 1), st.integers(0, 2**16 - 1)), max_size=8),
    st.floats(0.0, 1e9),
)
def test_hostile_labels_count_only_ids_of_the_run(first, run, news, stamp_s):
    known = census((OWN, NOW_S, FIRST_QUEUE))
    known.merge(Summary(0, first, run, tuple(news), ()), stamp_s, NOW_S, sender=1)
    found = counted(known)
    assert 1 <= found.total <= IDS
    assert sum(found.members) + sum(found.holders) <= found.total
    again_first, again = known.wire(NOW_S)
    assert again_first + len(again) // 2 <= IDS


def test_ids_beyond_the_greatest_are_not_counted():
    known = Census(OWN, 2**16)
    known.hear(MAX_LABELLED, NOW_S, FIRST_QUEUE)
    known.hear(MAX_LABELLED - 1, NOW_S, FIRST_QUEUE)
    assert counted(known).total == 1


@settings(derandomize=True, deadline=None)
@given(
    st.lists(
        st.tuples(st.lists(st.tuples(members, st.integers(0, 9)), max_size=4), st.floats(0.5, 5.0)),
        max_size=30,
    )
)
@example([([(1, 0)], 0.5), *[([], 0.5)] * 23, ([], 5.0)])
def test_who_is_late_is_asked_for_whatever_was_asked_before(steps):
    """T_lost may become longer and shorter."""
    known, last_s = census(), {}
    for step, (heard, lost_s) in enumerate(steps):
        now_s = NOW_S + ASK_S * step
        for member, ago in heard:
            stamp_s = now_s - QUANTUM_S * ago
            known.hear(member, stamp_s, FIRST_QUEUE)
            last_s[member] = max(last_s.get(member, 0.0), stamp_s)
        known.news(now_s)
        known.ask(now_s, lost_s)
        fresh = census(*[(member, stamp_s, FIRST_QUEUE) for member, stamp_s in last_s.items()])
        fresh.news(now_s)
        fresh.ask(now_s, lost_s)
        assert known.news(now_s) == fresh.news(now_s)


@pytest.mark.parametrize("seed", range(3))
def test_nobody_asks_for_members_whose_labels_take_long_as_usual(seed):
    """Answers come sooner than repeated labels. They must not hide how long those take."""
    random, line, settled_s = Random(seed), 12, 20.0
    known = [census(own=each, ids=line) for each in range(line)]
    begin = [random.random() for _ in range(line)]
    asked = 0
    for tick in range(400):
        now_s = 0.1 * tick
        for each, mine in enumerate(known):
            mine.hear(each, now_s, FIRST_QUEUE)
            before = mine.news_number
            mine.ask(now_s, LOST_S)
            asked += mine.news_number - before if now_s > settled_s else 0
            regular = (now_s - begin[each]) % 1.0 < 0.1
            if not regular and not mine.has_news:
                continue
            summary = told(mine, now_s, regular)
            for near in (each - 1, each + 1):
                if 0 <= near < line:
                    known[near].hear(each, now_s, FIRST_QUEUE)
                    known[near].merge(summary, now_s, now_s, sender=1)
        if now_s > settled_s:
            counts = [mine.population(now_s, LOST_S + ANSWER_S, QUEUES, 0) for mine in known]
            assert {each.total for each in counts} == {line}
    assert asked == 0
