"""A plan with short longest ways: of the same sum of squares, apart and in touch on the way."""

from itertools import combinations
from math import dist, isclose

import pytest

from agent.structure.longest_way import APART, IN_TOUCH, MOST_MEMBERS, shortened

SPACING_M = 1.0
LOOKS = 200


def line(members):
    return [(0.5 * (members - 1) - k, 0.0, 0.0) for k in range(members)]


def turned(points):
    """Return points turned by 90 degrees about the origin."""
    return [(-y, x, z) for x, y, z in points]


def ways(plan, starts, ends):
    return [dist(start, ends[k]) for start, k in zip(starts, plan, strict=True)]


def flight(plan, starts, ends):
    """Yield where all are, as they fly straight and equally fast until they arrive."""
    longest_m = max(ways(plan, starts, ends))
    for look in range(LOOKS + 1):
        flown_m = longest_m * look / LOOKS
        yield [_between(start, ends[k], flown_m) for start, k in zip(starts, plan, strict=True)]


def _between(start, end, flown_m):
    way_m = dist(start, end)
    share = min(1.0, flown_m / way_m) if way_m else 1.0
    return tuple(a + share * (b - a) for a, b in zip(start, end, strict=True))


def longest_link_m(points):
    """Return the longest link of the shortest links that connect all points [m]."""
    joined, left, longest_m = [points[0]], points[1:], 0.0
    while left:
        link_m, nearest = min((min(dist(a, b) for b in joined), a) for a in left)
        longest_m = max(longest_m, link_m)
        left.remove(nearest)
        joined.append(nearest)
    return longest_m


@pytest.mark.parametrize("members", [4, 7, 12])
def test_a_line_that_turns_on_the_spot_arrives_sooner(members):
    starts, ends = line(members), turned(line(members))
    kept = list(range(members))
    plan = shortened(kept, starts, ends, SPACING_M)
    assert sorted(plan) == kept
    squares = [sum(way * way for way in ways(each, starts, ends)) for each in (kept, plan)]
    assert isclose(*squares)
    assert max(ways(plan, starts, ends)) < 0.85 * max(ways(kept, starts, ends))


@pytest.mark.parametrize("members", [4, 7, 12])
def test_all_stay_apart_and_in_touch_on_the_way(members):
    starts, ends = line(members), turned(line(members))
    plan = shortened(range(members), starts, ends, SPACING_M)
    for points in flight(plan, starts, ends):
        assert min(dist(a, b) for a, b in combinations(points, 2)) > APART * SPACING_M - 1e-9
        assert longest_link_m(points) < IN_TOUCH * SPACING_M + 0.1  # between two looks


def test_a_team_that_is_only_displaced_keeps_its_order():
    starts = line(9)
    ends = [(x + 5.0, y + 2.0, z) for x, y, z in starts]
    assert shortened(range(9), starts, ends, SPACING_M) == list(range(9))


def test_no_exchange_makes_the_sum_of_squares_larger():
    """The ends would gain by an exchange, but fly across the others."""
    starts = line(6)
    ends = [(0.9 * x - 0.3 * y, 0.3 * x + 0.9 * y, z) for x, y, z in starts]
    assert shortened(range(6), starts, ends, SPACING_M) == list(range(6))


def test_a_large_team_keeps_its_plan():
    starts = line(MOST_MEMBERS + 1)
    kept = list(range(MOST_MEMBERS + 1))
    assert shortened(kept, starts, turned(starts), SPACING_M) == kept
