"""Allocation: one place for each agent, a sum near the least one, and stability against noise."""

from itertools import combinations, permutations
from math import cos, pi, sin
from random import Random

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from agent.assignment.allocation import CONFLICT_M, HYSTERESIS_M2, allocate
from tests.agent.comms.builders import peer, places

coordinate = st.floats(-10.0, 10.0)
points = st.tuples(coordinate, coordinate, coordinate)
situations = st.integers(1, 12).flatmap(
    lambda n: st.tuples(
        st.lists(points, min_size=n, max_size=n),
        st.lists(points, min_size=n, max_size=n),
        st.lists(st.none() | st.integers(0, n - 1), min_size=n, max_size=n),
    )
)


def random_points(random, count, size=2.5):
    return [tuple(random.uniform(-size, size) for _ in range(3)) for _ in range(count)]


def team_of(positions, claims=None):
    ranks = claims or [None] * len(positions)
    by_rank = places(len(positions))
    return [
        peer(agent_id, at, None if rank is None else by_rank[rank])
        for agent_id, (at, rank) in enumerate(zip(positions, ranks, strict=True))
    ]


def allocated(positions, slots, claims=None):
    """Return the rank of each agent's place, by id."""
    found = allocate(team_of(positions, claims), places(len(slots)), slots)
    return [found[agent_id].rank for agent_id in range(len(positions))]


def square(a, b):
    return sum((x - y) ** 2 for x, y in zip(a, b, strict=True))


def cost(positions, slots, ranks, claims=None):
    """Return the minimised sum: squared distances, less the hysteresis of kept claims [m^2]."""
    return sum(
        square(at, slots[rank]) - HYSTERESIS_M2 * (claims is not None and claims[agent_id] == rank)
        for agent_id, (at, rank) in enumerate(zip(positions, ranks, strict=True))
    )


@settings(derandomize=True, deadline=None)
@given(situations)
def test_each_agent_gets_exactly_one_place(situation):
    positions, slots, claims = situation
    assert sorted(allocated(positions, slots, claims)) == list(range(len(slots)))


@settings(derandomize=True, deadline=None)
@given(situations, st.integers(0, 11))
def test_with_too_few_places_each_place_is_given_once(situation, count):
    positions, slots, claims = situation
    some = slots[: min(count, len(slots))]
    found = allocate(team_of(positions, claims), places(len(some)), some)
    given_out = [place.rank for place in found.values() if place is not None]
    assert sorted(given_out) == list(range(len(some)))
    assert list(found) == list(range(len(positions)))


@settings(derandomize=True, deadline=None)
@given(situations)
def test_no_exchange_of_two_agents_saves_anything(situation):
    positions, slots, _ = situation
    ranks = allocated(positions, slots)
    before = cost(positions, slots, ranks)
    for a, b in combinations(range(len(ranks)), 2):
        other = list(ranks)
        other[a], other[b] = other[b], other[a]
        assert cost(positions, slots, other) >= before - 1e-6


@settings(derandomize=True, deadline=None)
@given(situations)
def test_undisputed_claims_are_given_up_only_for_a_lower_cost(situation):
    positions, slots, _ = situation
    claims = list(reversed(range(len(slots))))
    ranks = allocated(positions, slots, claims)
    assert cost(positions, slots, ranks, claims) <= cost(positions, slots, claims, claims) + 1e-9


def test_an_allocation_that_is_claimed_is_stable():
    random = Random(4)
    for _ in range(300):
        positions, slots = random_points(random, 9), random_points(random, 9)
        ranks = allocated(positions, slots)
        assert allocated(positions, slots, ranks) == ranks


def test_ids_do_not_matter():
    random = Random(5)
    for _ in range(300):
        positions, slots = random_points(random, 8), random_points(random, 8)
        ranks = allocated(positions, slots)
        order = random.sample(range(8), 8)
        renamed = allocated([positions[row] for row in order], slots)
        assert renamed == [ranks[row] for row in order]


def moved(points_m, yaw, shift):
    c, s = cos(yaw), sin(yaw)
    return [
        (c * x - s * y + shift[0], s * x + c * y + shift[1], z + shift[2]) for x, y, z in points_m
    ]


def test_moving_and_turning_the_world_changes_nothing():
    random = Random(6)
    for _ in range(300):
        positions, slots = random_points(random, 8), random_points(random, 8)
        where = random.uniform(-pi, pi), tuple(random.uniform(-500.0, 500.0) for _ in range(3))
        ranks = allocated(positions, slots)
        assert allocated(moved(positions, *where), moved(slots, *where)) == ranks
        claims = random.sample(range(8), 8)
        assert allocated(moved(positions, *where), moved(slots, *where), claims) == allocated(
            positions, slots, claims
        )


@pytest.mark.parametrize("seed", range(5))
def test_a_centimetre_of_noise_flips_nothing(seed):
    """E17: on a ring every agent has two places at one distance; 0 flips in 600 updates."""
    random, count = Random(seed), 6
    ring = [(cos(pi * k / 3), sin(pi * k / 3), 0.0) for k in range(count)]
    slots = [
        (0.5 * cos(pi * (2 * k + 1) / 6), 0.5 * sin(pi * (2 * k + 1) / 6), 0.0) for k in range(6)
    ]
    claims = allocated(ring, slots)
    for _ in range(600):
        noisy = [tuple(x + random.gauss(0.0, 0.01) for x in at) for at in ring]
        now = allocated(noisy, slots, claims)
        assert now == claims
        claims = now


@pytest.mark.parametrize(("gain_m2", "changes"), [(0.8, False), (0.99, False), (1.01, True)])
def test_an_exchange_must_save_more_than_the_hysteresis_of_both_claims(gain_m2, changes):
    """Each of two agents stands nearer to the other's place, by half the gain."""
    half = 0.25 * gain_m2
    slots = [(-1.0, 0.0, 0.0), (1.0, 0.0, 0.0)]
    positions = [(half / 2.0, 0.0, 0.0), (-half / 2.0, 0.0, 0.0)]
    saved = cost(positions, slots, [0, 1]) - cost(positions, slots, [1, 0])
    assert saved == pytest.approx(gain_m2)
    assert allocated(positions, slots, [0, 1]) == ([1, 0] if changes else [0, 1])


def disputed(first_m2, second_m2):
    """Return the agent that keeps place 0, claimed by both, at these squared distances [m^2].

    Place 1 is at the same distance for both.
    """
    slots = [(0.0, 0.0, 0.0), (0.0, 0.0, 0.0)]
    positions = [(first_m2**0.5, 0.0, 0.0), (0.0, second_m2**0.5, 0.0)]
    return allocated(positions, slots, [0, 0]).index(0)


def test_a_conflict_goes_to_the_nearer_by_a_margin_else_to_the_lower_id():
    assert disputed(1.0, 1.0) == 0
    assert disputed(1.0, (1.0 - 0.9 * CONFLICT_M) ** 2) == 0
    assert disputed(1.0, (1.0 - 1.1 * CONFLICT_M) ** 2) == 1
    assert disputed(1.0, 2.0) == 0


def test_a_claim_to_a_place_that_does_not_exist_is_ignored():
    positions, slots = [(0.0, 0.0, 0.0), (1.0, 0.0, 0.0)], [(1.0, 0.0, 0.0), (0.0, 0.0, 0.0)]
    stranger = places(9)[8]
    team = [peer(0, positions[0], stranger), peer(1, positions[1], stranger)]
    found = allocate(team, places(2), slots)
    assert [found[agent_id].rank for agent_id in (0, 1)] == allocated(positions, slots) == [1, 0]


@pytest.mark.parametrize("far_m", [1e4, 1e5, 1e6])
def test_it_ends_at_any_reported_distance(far_m):
    """Squares are rounded: an exchange and its reverse can both seem to save something."""
    random = Random(7)
    for _ in range(100):
        y = random.uniform(0.1, 3.0)
        positions = [(far_m, 0.0, 0.0), *[(random.uniform(-3.0, 3.0), 0.0, 0.0) for _ in range(5)]]
        slots = [(0.1 * k, side * y, 0.0) for k in range(3) for side in (1.0, -1.0)]
        assert sorted(allocated(positions, slots)) == list(range(6))


def gaps(count, cases, seed):
    """Return by which shares the sums exceed the least ones, sorted."""
    random = np.random.default_rng(seed)
    every = np.array(list(permutations(range(count))))
    found = []
    for _ in range(cases):
        positions, slots = random.uniform(-2.5, 2.5, (2, count, 3))
        squares = ((positions[:, None] - slots[None]) ** 2).sum(axis=2)
        ranks = allocated([*map(tuple, positions.tolist())], [*map(tuple, slots.tolist())])
        least = squares[np.arange(count), every].sum(axis=1).min()
        found.append(float(squares[np.arange(count), ranks].sum() / least) - 1.0)
    return sorted(found)


@pytest.mark.parametrize("count", range(2, 8))
def test_the_sum_is_within_a_few_percent_of_the_least_sum(count):
    """For random places in a cube, the hardest case, on average; single cases reach some 70 %."""
    found = gaps(count, 600, seed=count)
    assert found[0] > -1e-9
    assert sum(found) / len(found) < 0.03
    assert found[int(0.95 * len(found))] < 0.18
    assert sum(gap < 1e-9 for gap in found) > 0.7 * len(found)
    assert found[-1] < 1.0
