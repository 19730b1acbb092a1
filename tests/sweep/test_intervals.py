"""Intervals of shares and differences, against published figures."""

import pytest

from worldsim.sweep.intervals import Pairs, paired_mean, paired_share, student_quantile, wilson


def test_wilsons_interval() -> None:
    # Newcombe (1998), "Two-sided confidence intervals for the single proportion", table I.
    found = wilson(81, 263)
    assert found is not None
    assert (found.low, found.high) == pytest.approx((0.2553, 0.3662), abs=5e-5)
    assert wilson(0, 20) == pytest.approx((0.0, 0.0, 0.1611), abs=5e-5)
    assert wilson(0, 0) is None


@pytest.mark.parametrize(("freedom", "quantile"), [(1, 12.706), (2, 4.303), (19, 2.093)])
def test_students_quantile(freedom: int, quantile: float) -> None:
    assert student_quantile(freedom) == pytest.approx(quantile, abs=2e-3)


def test_newcombes_interval_of_paired_shares() -> None:
    # Newcombe (1998), "... based on paired data", table II, method 10.
    found = paired_share(Pairs(both=36, first=12, second=2, neither=0))
    assert found is not None
    assert (-found.value, -found.high, -found.low) == pytest.approx((0.2, 0.0569, 0.3404), abs=5e-5)
    same = paired_share(Pairs(20, 0, 0, 0))
    assert same is not None
    assert (same.value, -same.low) == pytest.approx((0.0, same.high))
    assert same.high > 0.1


def test_the_mean_of_paired_differences() -> None:
    found = paired_mean([1.0, 2.0, 3.0])
    assert found is not None
    assert (found.value, found.high - found.value) == pytest.approx((2.0, 4.303 / 3**0.5), abs=1e-2)
    assert paired_mean([1.0]) is None
