"""Transfers between queues: nothing is lost, nobody gives more than it has too much."""

from itertools import pairwise

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from agent.messages import ZERO
from agent.structure.transfers import transfers
from tests.agent.structure.builders import LIBRARY, library, lines, rays

ONE_HOME = rays((-1.0, 1.0, 0.0), (-1.0, -1.0, 0.0), (-1.0, 0.0, 1.0))
OWN_HOMES = lines(ZERO, (0.0, 3.0, 0.0), (0.0, 6.0, 0.0), (0.0, 9.0, 0.0))


@st.composite
def unbalanced(draw, queues):
    counts = draw(st.lists(st.integers(0, 30), min_size=queues, max_size=queues))
    cuts = sorted(draw(st.lists(st.integers(0, sum(counts)), min_size=queues - 1, max_size=9)))
    cuts = [0, *cuts[: queues - 1], sum(counts)]
    return counts, [b - a for a, b in pairwise(cuts)]


@settings(derandomize=True)
@given(unbalanced(4))
def test_under_several_leaders_the_transfers_bring_the_shares_exactly(case):
    counts, shares = case
    moved = [*counts]
    for giver, takers in transfers(OWN_HOMES, counts, shares).items():
        for taker, number in enumerate(takers):
            moved[giver] -= number
            moved[taker] += number
        assert counts[giver] - sum(takers) == shares[giver], "it gives all it has too much"
        assert takers[giver] == 0
    assert moved == shares


def test_the_nearest_queues_give_and_take_first():
    assert transfers(OWN_HOMES, (0, 2, 2, 0), (1, 1, 1, 1)) == {1: [1, 0, 0, 0], 2: [0, 0, 0, 1]}


@settings(derandomize=True)
@given(unbalanced(3))
def test_the_queues_of_one_leader_may_give_to_all_that_lack(case):
    counts, shares = case
    given_ = transfers(ONE_HOME, counts, shares)
    lacking = [max(0, share - count) for share, count in zip(shares, counts, strict=True)]
    givers = {j for j in range(3) if counts[j] > shares[j]}
    assert set(given_) == givers
    assert all(takers == lacking for takers in given_.values())


@pytest.mark.parametrize("counts", [(0, 0, 0, 0), (1, 2, 3, 4)])
def test_where_the_counts_are_the_shares_nothing_moves(counts):
    assert transfers(OWN_HOMES, counts, counts) == {}


@pytest.mark.parametrize("path", LIBRARY, ids=lambda path: path.stem)
def test_the_shares_are_those_of_the_layout(path):
    """Largest remainders, as Formation.divide has them (E16): members and holders are all."""
    formation = library(path)
    for agents in range(2, 31, 4):
        shares = formation.members(agents)
        places = formation.formation.layout(agents).places
        for j, share in enumerate(shares):
            inner = [place for place in places if place.queue == j]
            assert share == sum(formation.number(place) > 0 for place in inner)
