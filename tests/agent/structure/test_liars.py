"""A member that lies about the structure misleads the others while it speaks, and not for long."""

from itertools import product
from time import process_time

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from agent.controller import HeardSummary
from agent.messages import (
    MAX_TEAM,
    Place,
    RootKey,
    Summary,
    Swap,
    TreeReport,
)
from agent.places.place_points import OwnTarget
from agent.structure.census import (
    LAGS,
    MAX_LAG_S,
    QUANTUM_S,
    Census,
)
from agent.structure.claim import Claim
from agent.structure.election import Election
from agent.structure.label_code import FIRST_QUEUE, FIRST_VERTEX
from agent.structure.numbers import Numbers
from agent.structure.slow_layer import SlowLayer
from agent.structure.swaps import Swaps
from agent.structure.tree import Tree, version_at
from tests.agent.structure.builders import LINE, TWO, heard, leader_summary, view
from tests.agent.structure.test_team import MAPS, check_stays, team
from tests.random_flights.lies import Lies

LIAR, IDS = 5, 12
GREATEST, LAST_INDEX = 2**53 - 1, 2**15 - 1
ROOT = RootKey(100, 2)
NOW_S, LOST_S = 30.0, 2.0


class LyingStructure:
    """A member's structure that says anything, and claims any place."""

    def __init__(self, own_id, honest):
        self._honest, self._lies = honest, Lies(own_id)
        self.cost_m = 0.0

    def select(self, senses):
        self._senses = senses
        own = self._honest.select(senses)
        if own is None:
            return None
        return OwnTarget(self._lies.place(senses), own.slot, own.vertex)

    def words(self, now_s):
        self._honest.words(now_s)
        return self._lies.words(self._senses)


@pytest.mark.parametrize("gather", [False, True])
@pytest.mark.parametrize(("name", "agents"), [("line", 6), ("wedge", 7), ("figure-1b", 7)])
def test_lies_stop_nobody_and_a_team_forms_once_the_liar_is_silent(name, agents, gather):
    flown = team(MAPS[name], agents, loss=0.2, gather=gather)
    flown.run(2.0)
    liar = flown.members[LIAR]
    liar.structure = LyingStructure(LIAR, liar.structure)
    flown.run(6.0)
    del flown.members[LIAR]
    assert flown.until_formed(40.0)
    check_stays(flown)


def slow_layer(ids=IDS):
    made = SlowLayer(1, 0, LINE, Census(1, ids), 0.5)
    tree = Tree(1, NOW_S)
    tree.root, tree.version, tree.parent, tree.tier = ROOT, version_at(NOW_S), 2, 3
    return made, tree


def say(slow, tree, sender=LIAR, now_s=NOW_S, **fields):
    """Let an agent pass on what it says is the leader's summary."""
    fields = {"version": version_at(now_s), "counts": (4,), "highest": (4,), "total": 5, **fields}
    down = leader_summary(root=ROOT, **fields)
    report = TreeReport(vertex=0, tier=0, parent=-1, down=down, up=None)
    slow.hear([HeardSummary(sender, now_s, Summary(0, 0, b"", (), (report,)))], [tree], now_s)
    return slow.summaries[0] == down


@pytest.mark.parametrize(
    "lie",
    [
        {"version": GREATEST},
        {"version": version_at(NOW_S + 1.5)},
        {"order": GREATEST},
        {"order": version_at(NOW_S) + 1},
        {"total": IDS + 1},
        {"counts": (6,)},
        {"counts": (1, 1)},
        {"highest": (1,) * 64},
    ],
    ids=str,
)
def test_a_summary_that_no_leader_can_have_written_is_not_passed_on(lie):
    slow, tree = slow_layer()
    assert not say(slow, tree, **lie)
    assert say(slow, tree, sender=2)


def test_a_summary_invented_in_a_leaders_name_is_superseded_within_a_second():
    slow, tree = slow_layer()
    latest = version_at(NOW_S + 1.0)
    assert say(slow, tree, version=latest, order=latest, total=9, counts=(9,))
    assert say(slow, tree, sender=2, now_s=NOW_S + 1.1)


ODD_PLACES = [(LAST_INDEX, 3), (64, 0), (-1, -1), (-1, 3), (0, LAST_INDEX), (0, -1), (1, 0)]


FORMATIONS = pytest.mark.parametrize(
    "formation", [LINE, TWO, MAPS["figure-1b"]], ids=["line", "two", "closed"]
)
QUEUES = pytest.mark.parametrize("queue", [LAST_INDEX, 64, 1, 0, -1])


def counted(formation):
    """Return the leaders' summaries of a team of nine."""
    return [
        leader_summary(
            root=RootKey(0, v), total=9, counts=(3,) * len(homed), highest=(3,) * len(homed)
        )
        for v, homed in enumerate(formation.homed)
    ]


@FORMATIONS
@QUEUES
@pytest.mark.parametrize("place", ODD_PLACES, ids=str)
def test_a_place_that_there_is_not_is_neither_taken_nor_swapped(formation, queue, place):
    own, known = formation.place(0, 2), Place(*place)
    for swap in (Swap(1, place, own), Swap(1, own, place), Swap(1, place, place)):
        for claimed, said in product((known, own), ("proposal", "reservation")):
            liar = heard(LIAR, (9.0, 0.0, 0.0), claimed, queue=queue, **{said: swap})
            seen = view(formation, NOW_S, [liar], summaries=counted(formation))
            claim = Claim(0.0)
            claim.take(0, 2, 1.0, 0.0)
            swaps = Swaps(1)
            swaps.proceed(seen, claim)
            swaps.propose(seen, claim)
            Numbers(1, 0.0).keep_up(seen, claim)
            assert formation.slot(claim.queue, claim.number, 9) is not None


@FORMATIONS
@QUEUES
def test_who_says_that_it_belongs_to_a_queue_that_there_is_not_stands_for_no_vertex(
    formation, queue
):
    claim = Claim(0.0)
    claim.give_up(0, 0.0)
    far = heard(LIAR, (900.0, 0.0, 0.0), queue=queue)
    trees = [Tree(1, 0.0) for _ in range(formation.vertices)]
    assert Election(1, 0.0).stand(view(formation, NOW_S, [far]), claim, trees)


def test_a_liar_that_pushes_cannot_drive_a_number_without_bound():
    claim, numbers = Claim(0.0), Numbers(1, 0.0)
    claim.take(0, MAX_TEAM, 1.0, 0.0)
    liar = heard(0, place=LINE.place(0, MAX_TEAM), pushes=True)
    assert numbers.keep_up(view(LINE, NOW_S, [liar]), claim)
    assert claim.number == 1


def population(census, now_s):
    return census.population(now_s, LOST_S, 2, 1)


lies = st.lists(
    st.builds(
        Summary,
        mission=st.just(0),
        first=st.integers(0, IDS + 3),
        labels=st.binary(max_size=40),
        news=st.lists(st.tuples(st.integers(0, 40), st.integers(0, 2**16 - 1)), max_size=8).map(
            tuple
        ),
        trees=st.just(()),
    ),
    max_size=6,
)


@settings(derandomize=True, deadline=None)
@given(lies, st.floats(0.0, NOW_S))
def test_no_label_makes_others_forget_a_member_that_is_there(told, stamp_s):
    """Labels only become later, so a lie can but keep a member in the count."""
    census = Census(1, IDS)
    for member in (1, 2, 3):
        census.hear(member, NOW_S - 0.5, FIRST_QUEUE)
    for summary in told:
        census.merge(summary, stamp_s, NOW_S, sender=1)
    assert population(census, NOW_S).total >= 3
    for member in (1, 2, 3):
        census.hear(member, NOW_S + QUANTUM_S, FIRST_QUEUE + 1)
    assert population(census, NOW_S + QUANTUM_S).members[1] >= 3


@settings(derandomize=True, deadline=None)
@given(lies, st.floats(0.0, NOW_S))
def test_invented_members_are_those_of_the_run_and_end_after_the_liar(told, stamp_s):
    census = Census(1, IDS)
    for k in range(20):
        for summary in told:
            census.merge(summary, stamp_s + 0.5 * k, NOW_S + 0.5 * k, sender=1)
    assert population(census, NOW_S + 10.0).total <= IDS
    silent_s = NOW_S + 10.0 + LOST_S + LAGS * MAX_LAG_S + 2.0 * QUANTUM_S
    assert population(census, silent_s).total == 0


def test_a_label_of_anothers_queue_holds_until_the_member_itself_is_heard_later():
    census = Census(1, IDS)
    census.hear(3, NOW_S - 0.5, FIRST_QUEUE)
    lie = Summary(0, 0, b"", ((3, 255 - FIRST_VERTEX),), ())
    census.merge(lie, NOW_S, NOW_S, sender=1)
    assert population(census, NOW_S).holders == (1,)
    census.hear(3, NOW_S + QUANTUM_S, FIRST_QUEUE)
    assert population(census, NOW_S + QUANTUM_S).members == (1, 0)


def test_a_place_of_any_rank_costs_no_time():
    """An open queue is measured no farther than any team reaches."""
    formation = MAPS["line"].formation
    began = process_time()
    assert all(formation.slot(Place(0, rank), 9) is None for rank in range(30_000, LAST_INDEX))
    for number in range(1, LAST_INDEX, 7):
        MAPS["figure-1b"].slot(0, number, number)
    assert process_time() - began < 1.0
