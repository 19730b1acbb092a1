"""Who leads a vertex: the nearest at first, and one that stands there before one that cannot."""

import pytest

from agent.messages import Place
from agent.structure.claim import Claim
from agent.structure.election import Election
from agent.structure.tree import Tree
from tests.agent.structure.builders import LINE, heard, view

APEX = Place(0, 0)
LONG_AFTER_S = 60.0


def elected(own_id, at, number=0, blocked=()):
    """Return the key of an agent that hears no leader for long, None if it does not lead."""
    claim, election, tree = Claim(0.0), Election(own_id, 0.0), Tree(own_id, 0.0)
    claim.queue = 0
    if number:
        claim.take(0, number, 0.0, 0.0)
    seen = view(LINE, LONG_AFTER_S, at=at, blocked=blocked)
    return election.key if election.stand(seen, claim, [tree]) else None


def test_who_leads_from_its_queue_makes_way_for_who_stands_in_the_vertex():
    """Where two teams meet again, the lower key leads, and nobody has to change places."""
    in_queue = elected(3, (-1.0, 0.0, 0.0), number=1, blocked=[APEX])
    in_vertex = elected(7, (-8.0, 0.0, 0.0), number=8)
    assert in_vertex < in_queue


@pytest.mark.parametrize(("other_m", "leads"), [(-1.0, False), (-3.0, True)])
def test_of_two_that_start_the_nearer_leads(other_m, leads):
    claim, election, tree = Claim(0.0), Election(3, 0.0), Tree(3, 0.0)
    claim.queue = 0
    other = heard(4, (other_m, 0.0, 0.0))
    seen = view(LINE, 1.0, [other], at=(-2.0, 0.0, 0.0))
    assert election.stand(seen, claim, [tree]) == leads
