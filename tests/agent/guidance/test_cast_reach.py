"""d_c2 follows the range of the radio where the scenario leaves it out (Lemma 7, E20)."""

from math import pi, radians

import pytest

from agent.config import Control
from agent.guidance.bobber import bobber, cast_reach, cast_zone
from agent.guidance.cone import Cone


@pytest.mark.parametrize(
    ("range_m", "reach_m"),
    [
        (None, 0.5),
        (60.0, 0.5),
        (3.0, 0.5),
        (2.0, 0.25),
        (1.6, 0.15),
        (1.4, 0.1),
        (0.3, 0.1),
        (0.0, 0.1),
    ],
)
def test_it_is_a_quarter_of_what_the_range_leaves_within_bounds(range_m, reach_m) -> None:
    assert cast_reach(Control(), range_m) == pytest.approx(reach_m)


def test_a_wider_spacing_leaves_less() -> None:
    assert cast_reach(Control(spacing_m=1.4), 2.0) == pytest.approx(0.15)


def test_it_is_at_least_twice_d_c1() -> None:
    assert cast_reach(Control(cast_near_m=0.2), 1.2) == pytest.approx(0.4)


@pytest.mark.parametrize("range_m", [None, 1.2, 9.0])
def test_a_given_one_stands(range_m) -> None:
    assert cast_reach(Control(cast_far_m=0.7), range_m) == 0.7


def test_a_shorter_range_casts_shorter() -> None:
    cone = Cone(radians(45), radians(45))
    for range_m in (1.5, 2.0, 2.5):
        reach = cast_reach(Control(), range_m)
        zone = cast_zone(cone, reach, 0.5, pi)
        x, _, _ = bobber((0.0, 0.0, 0.0), 0.0, (9.0, 0.0, 0.0), zone)
        assert x == pytest.approx(reach)
