"""I4: how long two agents may claim one place, also where the radio changes meanwhile."""

from math import inf

import numpy as np
import pytest

from worldsim.judge.shared_places import SharedPlaces

HELD = [(0, 1), (0, 1), (0, 2)]
TICK_S = 0.1


def first_violation_s(allowed: list[tuple[float, float]]) -> float | None:
    """Return when two agents have shared their place from 0 s on for too long [s].

    allowed: until when each time holds, and how long it lets them share it [s].
    """
    shared = SharedPlaces(local=False)
    shared.find(HELD, [[0, 1, 2]], None)
    now_s = tick = 0
    for until_s, longest_s in allowed:
        while (now_s := tick * TICK_S) < until_s:
            if shared.count_lasting(now_s, longest_s):
                return now_s
            tick += 1
    return None


@pytest.mark.parametrize(
    ("allowed", "at_s"),
    [
        ([(9.0, 1.0)], 1.1),
        ([(1.05, 1.0)], None),
        # Half of the time allowed under a bad radio, and half of it under a good one.
        ([(4.05, 8.0), (9.0, 1.0)], 4.6),
        ([(0.55, 1.0), (9.0, 8.0)], 4.6),
        ([(5.05, inf), (9.0, 1.0)], 6.1),
        ([(9.0, inf)], None),
    ],
)
def test_shares_of_the_time_allowed_add_up(
    allowed: list[tuple[float, float]], at_s: float | None
) -> None:
    found = first_violation_s(allowed)
    assert found == (None if at_s is None else pytest.approx(at_s))


def test_another_place_is_shared_anew() -> None:
    shared = SharedPlaces(local=False)
    shared.find(HELD, [[0, 1, 2]], None)
    assert [shared.count_lasting(t, 1.0) for t in (0.0, 0.9)] == [0, 0]
    shared.find([(0, 3), (0, 3), (0, 2)], [[0, 1, 2]], None)
    assert [shared.count_lasting(t, 1.0) for t in (1.0, 1.9, 2.1)] == [0, 0, 2]


def test_a_pair_is_given_its_time_whatever_rivals_came_before() -> None:
    shared = SharedPlaces(local=False)
    rivals = [[(0, 1), (0, 1), (0, 2)], [(0, 1), (0, 2), (0, 1)]]  # 0 with 1, then 0 with 2
    lasting = []
    for tick in range(40):
        shared.find(rivals[tick // 8 % 2], [[0, 1, 2]], None)
        lasting.append(shared.count_lasting(tick * TICK_S, 1.0))
    assert not any(lasting)
    assert shared.count_lasting(9.0, 1.0) == 2  # the last pair goes on for 5 s


def test_a_third_does_not_start_the_time_of_two_anew() -> None:
    shared = SharedPlaces(local=False)
    shared.find([(0, 1), (0, 1), (0, 2)], [[0, 1, 2]], None)
    assert [shared.count_lasting(t, 1.0) for t in (0.0, 0.9)] == [0, 0]
    shared.find([(0, 1), (0, 1), (0, 1)], [[0, 1, 2]], None)
    assert [shared.count_lasting(t, 1.0) for t in (1.0, 1.1)] == [0, 2]


def test_under_trees_two_share_a_place_only_where_each_hears_the_other() -> None:
    claims, members = [(0, 1), (0, 1)], [[0, 1]]
    for deaf in ((0, 1), (1, 0)):
        hears = np.ones((2, 2), dtype=bool)
        hears[deaf] = False
        shared = SharedPlaces(local=True)
        shared.find(claims, members, hears)
        assert [shared.count_lasting(t, 1.0) for t in (0.0, 9.0)] == [0, 0]
        shared.find(claims, members, np.ones((2, 2), dtype=bool))
        assert [shared.count_lasting(t, 1.0) for t in (9.1, 18.0)] == [0, 2]
