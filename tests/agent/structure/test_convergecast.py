"""What goes up a tree: sums of the followers' parts, each follower once, by its latest report."""

from collections import Counter

from hypothesis import given, settings
from hypothesis import strategies as st

from agent.messages import MAX_CANDIDATES, MAX_PLACES, Candidate, Place
from agent.structure import histogram
from agent.structure.convergecast import Convergecast, joined, own_part
from tests.agent.structure.builders import subtree

OWN, QUEUES = 7, 2

candidates = st.builds(Candidate, st.integers(-50, 50), st.integers(0, 9), st.integers(0, 3))
parts = st.builds(
    subtree,
    highest=st.tuples(st.integers(0, 9), st.integers(0, 9)),
    histogram=st.floats(0.0, 30.0).map(histogram.of_one),
    candidates=st.tuples(*[st.lists(candidates, max_size=3).map(tuple)] * QUEUES),
    blocked=st.lists(st.tuples(st.integers(0, 1), st.integers(0, 9)), max_size=3).map(tuple),
)


@settings(derandomize=True)
@given(st.lists(parts, max_size=6), st.randoms())
def test_the_order_of_the_parts_does_not_matter(given_, random):
    shuffled = [*given_]
    random.shuffle(shuffled)
    assert joined(shuffled, QUEUES) == joined(given_, QUEUES)


@settings(derandomize=True)
@given(st.lists(parts, min_size=1, max_size=6))
def test_a_sum_is_the_highest_the_nearest_and_all(given_):
    found = joined(given_, QUEUES)
    assert found.highest == tuple(max(each.highest[j] for each in given_) for j in range(QUEUES))
    assert sum(found.histogram) == len(given_)
    for j, kept in enumerate(found.candidates):
        offered = {each for part in given_ for each in part.candidates[j]}
        assert set(kept) <= offered
        assert len(kept) <= MAX_CANDIDATES
        assert not offered or kept[0] == min(offered)
    assert set(found.blocked) <= {Place(*place) for part in given_ for place in part.blocked}
    assert len(found.blocked) <= MAX_PLACES


def test_each_queue_keeps_candidates_however_far_it_is():
    near = [Candidate(k, k, to) for k in range(30) for to in (1, 2, 3)]
    far = [Candidate(1000 + k, k, 4) for k in range(30)]
    kept = joined([subtree(highest=(0,), candidates=(tuple(near + far),))], 1).candidates[0]
    assert {each.to for each in kept[:4]} == {1, 2, 3, 4}
    assert min(Counter(each.to for each in kept).values()) >= MAX_CANDIDATES // 4


@given(st.lists(parts, max_size=3), st.integers(0, 5), st.integers(0, 5))
def test_a_part_of_another_formation_does_not_count(given_, highest, offered):
    odd = subtree(highest=(1,) * highest, candidates=((),) * offered)
    counts = highest == offered == QUEUES
    assert joined([*given_, odd], QUEUES) == joined(given_, QUEUES) or counts


def test_the_part_of_an_agent_counts_in_its_own_queue():
    offer = Candidate(3, OWN, 0)
    part = own_part((0, 1), queue=1, number=4, away_m=2.0, candidates=(offer,))
    assert part == subtree(
        highest=(0, 4), histogram=histogram.of_one(2.0), candidates=((), (offer,))
    )
    other = own_part((0, 1), queue=5, number=4, away_m=2.0, candidates=(offer,))
    assert other == subtree(highest=(0, 0), histogram=histogram.EMPTY, candidates=((), ()))


def test_a_follower_counts_once_and_not_after_it_left():
    known = Convergecast(OWN)
    known.hear(3, OWN, subtree(highest=(1, 0)), 1.0)
    known.hear(3, OWN, subtree(highest=(2, 0)), 2.0)
    known.hear(4, OWN, subtree(highest=(3, 0)), 2.0)
    assert [each.highest for each in known.followers()] == [(2, 0), (3, 0)]
    known.hear(3, 4, subtree(highest=(2, 0)), 3.0)
    assert [each.highest for each in known.followers()] == [(3, 0)]
    known.hear(4, 3, None, 3.0)
    assert known.followers() == []


def test_a_report_without_room_for_what_goes_up_leaves_what_was_told():
    known = Convergecast(OWN)
    known.hear(3, OWN, subtree(highest=(1, 0)), 1.0)
    known.hear(3, OWN, None, 2.0)
    assert [each.highest for each in known.followers()] == [(1, 0)]


def test_a_report_that_was_overtaken_counts_for_nothing():
    known = Convergecast(OWN)
    known.hear(3, OWN, subtree(highest=(2, 0)), 2.0)
    known.hear(3, OWN, subtree(highest=(1, 0)), 1.0)
    known.hear(3, 4, subtree(highest=(1, 0)), 1.5)
    assert [each.highest for each in known.followers()] == [(2, 0)]


def test_old_reports_are_forgotten():
    known = Convergecast(OWN)
    known.hear(3, OWN, subtree(highest=(1, 0)), 1.0)
    known.hear(4, OWN, subtree(highest=(2, 0)), 2.0)
    known.forget(1.5)
    assert [each.highest for each in known.followers()] == [(2, 0)]
