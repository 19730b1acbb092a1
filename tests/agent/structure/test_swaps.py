"""Swaps of places: two agents agree, or both keep theirs; no loss leaves both with one place."""

from random import Random

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from agent.messages import Place, Swap
from agent.structure.claim import Claim
from agent.structure.swaps import Swaps
from tests.agent.structure.builders import LINE, heard, view

FIRST, SECOND, THIRD = (LINE.place(0, number) for number in (1, 2, 3))
TICK_S = 0.1


class Swapper:
    """An agent that does nothing but swap."""

    def __init__(self, own_id, at, number):
        self.id, self.at = own_id, at
        self.claim = Claim(-10.0)
        self.claim.take(0, number, 1.0, -10.0)
        self._swaps = Swaps(own_id)

    @property
    def place(self):
        return LINE.place(0, self.claim.number)

    def decide(self, now_s, others):
        seen = view(LINE, now_s, others, at=self.at)
        if not self._swaps.proceed(seen, self.claim):
            self._swaps.propose(seen, self.claim)

    def said(self):
        """Return the agent as others hear it."""
        return heard(
            self.id,
            self.at,
            self.place,
            cost_m=self.claim.cost_m,
            proposal=self.claim.proposal,
            reservation=self.claim.reservation,
        )


class Pair:
    """Some agents that hear each other a tick later, where ``hears(tick, to, sender)``."""

    def __init__(self, agents, hears=lambda *_: True):
        self.agents, self.tick = agents, 0
        self._hears = hears
        self._known = {each.id: {} for each in agents}

    def step(self):
        now_s = self.tick * TICK_S
        said = [each.said() for each in self.agents]
        for each in self.agents:
            for other in said:
                if other.id != each.id and self._hears(self.tick, each.id, other.id):
                    self._known[each.id][other.id] = (now_s, other)
        for each in self.agents:
            each.decide(now_s, [aged(now_s, *kept) for kept in self._known[each.id].values()])
        self.tick += 1

    def run(self, ticks):
        for _ in range(ticks):
            self.step()
        return [each.place for each in self.agents]


def aged(now_s, at_s, other):
    return heard(
        other.id,
        other.position,
        other.place,
        age_s=now_s - at_s,
        cost_m=other.cost_m,
        proposal=other.standing.proposal,
        reservation=other.standing.reservation,
    )


def crossed(ids=(1, 2)):
    """Return two agents that each stand in the other's place."""
    return [Swapper(ids[0], (-2.0, 0.0, 0.0), 1), Swapper(ids[1], (-1.0, 0.0, 0.0), 2)]


@pytest.mark.parametrize("ids", [(1, 2), (2, 1)])
def test_two_that_stand_in_each_others_places_swap(ids):
    assert Pair(crossed(ids)).run(12) == [SECOND, FIRST]


def test_two_that_stand_right_do_not_swap():
    agents = [Swapper(1, (-1.0, 0.0, 0.0), 1), Swapper(2, (-2.0, 0.0, 0.0), 2)]
    assert Pair(agents).run(30) == [FIRST, SECOND]
    assert [each.claim.proposal for each in agents] == [None, None]


def test_three_in_a_ring_end_in_the_best_places():
    agents = [
        Swapper(1, (-2.0, 0.0, 0.0), 1),
        Swapper(2, (-3.0, 0.0, 0.0), 2),
        Swapper(3, (-1.0, 0.0, 0.0), 3),
    ]
    assert Pair(agents).run(60) == [SECOND, THIRD, FIRST]


def no_place_is_lost(agents):
    """Whether two have different places, or exactly one keeps a place for the other."""
    one, other = agents
    kept = [each.claim.reservation for each in agents if each.claim.reservation is not None]
    return one.place != other.place or (len(kept) == 1 and kept[0].place != one.place)


DEAF_TICKS = 5
"""An adversary that makes an agent deaf for longer than an answer takes is Numbers' affair."""


@settings(derandomize=True, deadline=None, max_examples=60)
@given(st.integers(0, 10**9), st.sampled_from([0.1, 0.5, 0.8, 0.95]), st.booleans())
def test_no_adversary_takes_a_place_from_both(seed, loss, turned):
    """It drops what it likes, in either direction, but for at most half a second on end."""
    random, deaf = Random(seed), {}

    def hears(_, to, sender):
        lost = random.random() < loss and deaf.get((to, sender), 0) < DEAF_TICKS
        deaf[(to, sender)] = deaf.get((to, sender), 0) + 1 if lost else 0
        return not lost

    pair = Pair(crossed((9, 3) if turned else (3, 9)), hears)
    for _ in range(150):
        pair.step()
        assert no_place_is_lost(pair.agents)
    assert {each.place for each in pair.agents} == {FIRST, SECOND}


@pytest.mark.parametrize("deaf", [1, 2], ids=["the lower id is deaf", "the higher id is deaf"])
@pytest.mark.parametrize("from_tick", range(10))
def test_an_agent_that_goes_deaf_at_any_time_leaves_no_swap_under_way(deaf, from_tick):
    pair = Pair(crossed(), lambda tick, to, _: to != deaf or tick < from_tick)
    pair.run(60)
    hearing = pair.agents[2 - deaf]
    assert hearing.claim.reservation is None
    assert hearing.claim.number in (1, 2)


def test_a_proposal_without_an_answer_is_dropped():
    pair = Pair(crossed(), lambda _, to, __: to == 1)
    pair.run(2)
    assert pair.agents[0].claim.proposal == Swap(2, FIRST, SECOND)
    kept = pair.agents[0].claim.proposed_s
    pair.run(10)
    proposal = pair.agents[0].claim.proposal
    assert proposal is None or pair.agents[0].claim.proposed_s > kept
    assert pair.agents[0].place == FIRST


def test_who_has_a_swap_under_way_is_left_in_peace():
    claim = Claim(-10.0)
    claim.take(0, 1, 1.0, -10.0)
    for busy in ({"proposal": Swap(5, SECOND, THIRD)}, {"reservation": Swap(5, THIRD, SECOND)}):
        other = heard(2, (-1.0, 0.0, 0.0), SECOND, **busy)
        Swaps(1).propose(view(LINE, 0.0, [other], at=(-2.0, 0.0, 0.0)), claim)
        assert claim.proposal is None


@pytest.mark.parametrize("fields", [{"leads": 0}, {"pushes": True}])
def test_leaders_and_agents_that_push_swap_with_nobody(fields):
    claim = Claim(-10.0)
    claim.take(0, 1, 1.0, -10.0)
    other = heard(2, (-1.0, 0.0, 0.0), SECOND, **fields)
    Swaps(1).propose(view(LINE, 0.0, [other], at=(-2.0, 0.0, 0.0)), claim)
    assert claim.proposal is None


likely = st.sampled_from([FIRST, SECOND, THIRD])
places = likely | likely | st.tuples(st.integers(-1, 3), st.integers(-1, 2**15 - 1))
swaps = st.none() | st.builds(Swap, st.integers(0, 3), places, places)


@settings(derandomize=True, deadline=None, max_examples=400)
@given(st.lists(st.tuples(places, swaps, swaps), max_size=3), swaps, swaps)
def test_invented_swaps_leave_an_agent_with_a_place(others, proposal, reservation):
    """A liar may give its own place away, and no more: the agent keeps a place that there is."""
    claim = Claim(-10.0)
    claim.take(0, 2, 1.0, -10.0)
    claim.proposal, claim.reservation = proposal, reservation
    lies = [
        heard(k + 1, (-1.0, 0.0, 0.0), Place(*place), proposal=asked, reservation=kept)
        for k, (place, asked, kept) in enumerate(others)
    ]
    made = Swaps(0)
    for tick in range(3):
        seen = view(LINE, TICK_S * tick, lies, at=(-1.0, 0.0, 0.0))
        if not made.proceed(seen, claim):
            made.propose(seen, claim)
    assert claim.queue == 0
    assert claim.number >= 1
    assert claim.cost_m < 1e4


def test_nobody_proposes_while_a_mission_is_under_way():
    """Those who have it are on new ways, the others are not: what a swap gains is not known."""
    claim, swaps = Claim(-10.0), Swaps(1)
    claim.take(0, 1, 1.0, -10.0)
    seen = view(LINE, 0.0, [heard(2, (-1.0, 0.0, 0.0), SECOND)], at=(-4.0, 0.0, 0.0))
    seen.expected = 3
    swaps.propose(seen, claim)
    assert claim.proposal is None
    seen.expected = 0
    swaps.propose(seen, claim)
    assert claim.proposal == Swap(2, FIRST, SECOND)
