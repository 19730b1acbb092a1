"""Where a number breaks the team: what is fitted, and when it cannot be."""

from math import exp, inf, log

import pytest

from worldsim.sweep.logistic import Point, break_of


def points(*shares: int, flown: int = 20) -> list[Point]:
    return [Point(10.0 * index, passed, flown) for index, passed in enumerate(shares)]


def test_two_values_are_fitted_exactly() -> None:
    # A curve through 16 of 20 at 0 and 4 of 20 at 10: one half at 5, log odds from log 4 to -log 4.
    found = break_of(points(16, 4))
    assert (found.kind, found.falls) == ("break", True)
    assert found.at == pytest.approx(5.0)
    assert found.slope == pytest.approx(-2.0 * log(4.0) / 10.0)
    assert found.low is not None
    assert found.high is not None
    assert found.at - found.low == pytest.approx(found.high - found.at)


def test_the_interval_shrinks_with_the_flights_and_shifts_with_the_numbers() -> None:
    few, many = break_of(points(19, 15, 4, 1)), break_of(points(190, 150, 40, 10, flown=200))
    assert few.low is not None and few.high is not None
    assert many.low is not None and many.high is not None
    assert few.at == pytest.approx(many.at)
    assert (few.high - few.low) / (many.high - many.low) == pytest.approx(10.0**0.5, rel=0.1)
    far = break_of([Point(1e6 + point.x, *point[1:]) for point in points(19, 15, 4, 1)])
    assert far.at == pytest.approx(1e6 + few.at)  # type: ignore[operator]


def test_the_interval_holds_what_the_likelihood_ratio_does_not_rule_out() -> None:
    data = points(19, 15, 4, 1)

    def likelihood(middle: float, slope: float) -> float:
        odds = [slope * (point.x - middle) for point in data]
        return sum(
            point.passed * each - point.flown * log(1.0 + exp(each))
            for point, each in zip(data, odds, strict=True)
        )

    def best(middle: float) -> float:
        return max(likelihood(middle, -0.001 * step) for step in range(1, 600))

    found = break_of(data)
    for bound in (found.low, found.high):
        assert bound is not None
        ratio = 2.0 * (best(found.at or 0.0) - best(bound))
        assert ratio == pytest.approx(3.841, abs=0.01)


def test_a_share_that_rises() -> None:
    found = break_of(points(1, 5, 15, 19))
    assert (found.kind, found.falls) == ("break", False)
    assert found.at == pytest.approx(15.0)


def test_a_side_without_a_bound_is_open() -> None:
    found = break_of(points(16, 13, 9))
    assert found.kind == "break"
    assert (found.low is not None, found.high) == (True, inf)


@pytest.mark.parametrize(
    ("shares", "kind"),
    [
        ((20, 20, 20), "all pass"),
        ((0, 0), "all fail"),
        ((20, 20, 0), "separated"),
        ((0, 20), "separated"),
        ((10, 11, 9, 10), "no trend"),
        ((20, 20, 20, 14), "outside"),
        ((20,), "too few"),
        ((), "too few"),
    ],
)
def test_what_cannot_be_fitted_is_said(shares: tuple[int, ...], kind: str) -> None:
    assert break_of(points(*shares)).kind == kind


def test_separated_flights_tell_between_which_values() -> None:
    found = break_of(points(20, 20, 0, 0))
    assert (found.low, found.high, found.falls) == (10.0, 20.0, True)


def test_one_mixed_value_between_is_fitted() -> None:
    found = break_of(points(20, 9, 0))
    assert found.kind == "break"
    assert found.low is not None and found.high is not None
    assert 0.0 < found.low < 10.0 < found.high < 20.0
