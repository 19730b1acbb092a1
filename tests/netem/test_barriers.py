"""What lets no frame across: partitions of every kind, jams, and links that flap."""

from itertools import permutations

import pytest

from netem.barriers import Barriers
from netem.messages import Flap, Jam

AGENTS = range(7)


def open_links(barriers, now_s=0.0):
    return {pair for pair in permutations(AGENTS, 2) if not barriers.cut(*pair, now_s)}


def within(*groups):
    return {pair for group in groups for pair in permutations(group, 2)}


def parted(*arguments):
    barriers = Barriers()
    barriers.partition(*arguments)
    assert barriers.raised
    return open_links(barriers)


def test_agents_that_no_group_names_are_one_group_more():
    assert parted(((0, 1), (2,))) == within((0, 1), (2,), (3, 4, 5, 6))


def test_one_way_a_group_hears_all_and_is_heard_by_itself_alone():
    heard = within((0, 1), (2,), (3, 4, 5, 6))
    heard |= {(others, group) for others in (3, 4, 5, 6) for group in (0, 1, 2)}
    assert parted(((0, 1), (2,)), "one_way") == heard


def test_a_bridge_hears_both_sides_and_is_heard_by_both():
    through = {pair for pair in permutations(AGENTS, 2) if 6 in pair}
    assert parted(((0, 1, 2), (3, 4, 5)), "bridge", (6,)) == within((0, 1, 2), (3, 4, 5)) | through


def test_in_a_ring_everybody_hears_the_two_beside():
    ring = (4, 0, 2, 1, 3)
    beside = set(zip(ring, (*ring[1:], ring[0]), strict=True))
    assert parted((ring,), "ring") == beside | {(b, a) for a, b in beside} | within((5, 6))


@pytest.mark.parametrize("ring", [(0,), (0, 1), (0, 1, 2)])
def test_in_a_small_ring_everybody_is_beside_everybody(ring):
    rest = tuple(agent for agent in AGENTS if agent not in ring)
    assert parted((ring,), "ring") == within(ring, rest)


def test_a_heal_ends_the_partition_and_no_more():
    barriers = Barriers()
    barriers.partition(((0,),))
    barriers.jam(1, Jam((0.0, 0.0, 0.0), 1.0))
    barriers.heal()
    assert barriers.raised
    assert open_links(barriers) == within(AGENTS)
    barriers.jam(1, None)
    assert not barriers.raised


def test_a_jam_is_a_sphere_and_each_ends_by_its_number():
    barriers = Barriers()
    barriers.jam(1, Jam((0.0, 0.0, 0.0), 1.0))
    barriers.jam(2, Jam((5.0, 0.0, 0.0), 2.0))
    places = [(1.0, 0.0, 0.0), (0.8, 0.8, 0.0), (2.9, 0.0, 0.0), (3.0, 0.0, 0.0), (5.0, 1.4, 1.4)]
    assert [barriers.jammed(where) for where in places] == [True, False, False, True, True]
    barriers.jam(2, None)
    assert [barriers.jammed(where) for where in places] == [True, False, False, False, False]


def test_a_flap_is_down_for_the_first_half_of_each_period():
    barriers = Barriers()
    barriers.flap(3, Flap(2.0, 10.0))
    assert barriers.flapping
    down = [10.0, 10.5, 10.99, 12.0, 30.9]
    up = [11.0, 11.5, 11.99, 13.0, 31.0]
    assert all(open_links(barriers, now_s) == set() for now_s in down)
    assert all(open_links(barriers, now_s) == within(AGENTS) for now_s in up)


def test_a_flap_of_some_links_leaves_the_others_alone():
    barriers = Barriers()
    barriers.flap(3, Flap(2.0, 0.0, ((0, 1), (2, 3))))
    assert open_links(barriers) == within(AGENTS) - {(0, 1), (2, 3)}
    barriers.flap(3, None)
    assert not barriers.raised
    assert not barriers.flapping
