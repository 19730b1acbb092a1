"""What an agent says of other queues: the extra way that it would have."""

from agent.messages import ZERO
from agent.structure.claim import Claim
from agent.structure.queue_choice import QueueChoice
from tests.agent.structure.builders import leader_summary, lines, view

PAIR = lines(ZERO, (0.0, 5.0, 0.0))


def offers(own_at, summaries):
    claim = Claim(0.0)
    claim.take(0, 2, 0.0, 0.0)
    seen = view(PAIR, 1.0, at=own_at, summaries=summaries)
    return [(each.to, each.extra_dm) for each in QueueChoice(1).candidates(seen, claim)]


def test_the_way_to_a_queue_with_members_ends_behind_them():
    told = [
        leader_summary(total=9, counts=(6,), highest=(6,)),
        leader_summary(total=9, counts=(1,), highest=(1,)),
    ]
    assert offers((-2.0, 0.0, 0.0), told) == [(1, 50)]


def test_the_way_to_a_queue_without_any_ends_in_its_vacant_vertex():
    """Who is ordered there will lead it."""
    told = [leader_summary(total=9, counts=(8,), highest=(8,)), None]
    assert offers((-2.0, 0.0, 0.0), told) == [(1, round(10.0 * (2.0**2 + 5.0**2) ** 0.5))]
