"""The leader-follower graph: who follows whom, and how distance and bearing close."""

from math import acos, dist, hypot, sqrt
from random import Random

import pytest

from agent.schemes.approach import GAIN
from agent.schemes.leader_follower import (
    LeaderFollower,
    leader_of,
    links_needed,
    separation_bearing,
)
from agent.schemes.links import NOBODY, Situation
from tests.schemes.situations import LINES, WEDGE, heard, senses, setup

DT_S = 0.05


def followed(start, wanted, steps):
    """Return a follower's positions, seen from its leader [m]."""
    r, found = start, [start]
    for _ in range(steps):
        r = tuple(a + DT_S * b for a, b in zip(r, separation_bearing(r, wanted), strict=True))
        found.append(r)
    return found


def angle(a, b):
    return acos(sum(x * y for x, y in zip(a, b, strict=True)) / (hypot(*a) * hypot(*b)))


def test_each_follows_the_one_before_on_its_queue_and_the_first_follow_the_root():
    assert [leader_of(WEDGE.layout(9), node) for node in range(9)] == [
        *(NOBODY, 0, 0, 0, 0),
        *(1, 2, 3, 4),
    ]
    layout = LINES.layout(6)
    leads = {layout.places[k]: leader_of(layout, k) for k in range(6)}
    for place, leader in leads.items():
        if place.rank == 1:
            assert layout.places[leader] == (place.queue, 0)
    assert sorted(leads[place] for place in leads if place.rank == 0) == [NOBODY, 0, 0]


def test_distance_and_bearing_close_each_by_itself():
    random = Random(1)
    for _ in range(200):
        start, wanted = (tuple(random.uniform(-3, 3) for _ in range(3)) for _ in range(2))
        u = separation_bearing(start, wanted)
        outwards = sum(a * b for a, b in zip(u, start, strict=True)) / hypot(*start)
        assert outwards == pytest.approx(GAIN * (hypot(*wanted) - hypot(*start)))
        across = sqrt(max(0.0, hypot(*u) ** 2 - outwards**2))
        assert across == pytest.approx(GAIN * hypot(*start) * angle(start, wanted), abs=1e-6)
        assert dist(followed(start, wanted, 200)[-1], wanted) < 0.01


def test_who_is_on_the_wrong_side_flies_round_its_leader():
    way = followed((1.0, 0.0, 0.0), (-1.0, 0.0, 0.0), 200)
    assert min(hypot(*r) for r in way) > 0.95
    assert dist(way[-1], (-1.0, 0.0, 0.0)) < 0.01
    assert separation_bearing((-1.0, 0.0, 0.0), (-1.0, 0.0, 0.0)) == (0.0, 0.0, 0.0)


def test_the_root_flies_to_its_place_and_a_follower_from_its_leader():
    root = LeaderFollower(setup(0)).decide(senses((1.0, 0.0, 0.0)))
    assert root.place == WEDGE.layout(9).places[0]
    assert root.wanted == pytest.approx((-0.5, 0.0, 0.0))
    slot = WEDGE.layout(9).slots[WEDGE.layout(9).places[1]].point
    leader = heard(0, (5.0, 1.0, 0.0), velocity=(0.1, 0.0, 0.0))
    follower = LeaderFollower(setup(1)).decide(
        senses(tuple(a + b for a, b in zip(leader.position, slot, strict=True)), [leader])
    )
    assert follower.wanted == pytest.approx((0.1, 0.0, 0.0))
    assert follower.target == pytest.approx((5.0 + slot[0], 1.0 + slot[1], slot[2]))


def test_who_does_not_hear_its_leader_hovers_whoever_else_is_heard():
    others = [heard(k, (float(k), 0.0, 0.0)) for k in (0, 2, 3, 4, 6, 7, 8)]
    intent = LeaderFollower(setup(5)).decide(senses((0.0, 3.0, 0.0), others))
    assert intent.wanted == (0.0, 0.0, 0.0)
    assert intent.place is None


def test_it_needs_its_leader_alone():
    at = Situation(5, frozenset(range(9)), frozenset({3, 4}), leader=1, vertex_agent=0)
    assert links_needed(at) == {1}
    assert links_needed(at._replace(own=0, leader=NOBODY)) == set()
