"""Margins have the sign of the verdict, and the share of the limit as their size."""

import pytest

from worldsim.search.margins import approached, margins_of, of_error, score, violated


def summary(**rows: tuple[float | None, float | None, bool | None]) -> dict[str, object]:
    names = {
        "separation": "min_separation_m",
        "converge": "converge wedge",
        "again": "converge line",
    }
    expectations = [
        {
            "name": names[name],
            "wanted": wanted,
            "got": got,
            "held": held,
            "margin": None
            if wanted is None or got is None
            else (got - wanted if name == "separation" else wanted - got),
        }
        for name, (wanted, got, held) in rows.items()
    ]
    tallies = {"I1": (9, 1), "I5": (9, 0), "I7": (4, 2), "I2": (0, 0)}
    invariants = {name: {"ticks": a, "violations": b} for name, (a, b) in tallies.items()}
    return {"expectations": expectations, "invariants": invariants}


def test_margins_are_shares_of_the_limits() -> None:
    found = margins_of(
        summary(separation=(0.25, 0.5, True), converge=(40.0, 10.0, True), again=(40.0, 30.0, True))
    )
    assert found == {"separation": 1.0, "converge": 0.25, "I5": 1.0, "I7": -1.0}


def test_what_was_missed_is_negative_and_what_is_open_is_absent() -> None:
    found = margins_of(summary(separation=(0.25, 0.2, False), converge=(40.0, None, None)))
    assert found["separation"] == pytest.approx(-0.2)
    assert "converge" not in found
    assert margins_of(summary(converge=(40.0, None, False)))["converge"] == -1.0
    assert violated(found) == ["separation", "I7"]
    assert violated(of_error()) == ["error"]


def test_what_a_flight_starts_with_is_not_what_it_came_near_to() -> None:
    assert approached([0.1, 0.2, 0.5, 0.4, 0.6]) == 0.4
    assert approached([0.1, None, 0.05, 0.3]) == 0.05
    assert approached([0.1, 0.1, 0.2]) == approached([]) == 1.0


def test_the_score_falls_with_the_least_margin_first() -> None:
    assert score({"separation": 0.2, "converge": 1.0}) < score({"separation": 0.3, "converge": 0.3})
    assert score({"separation": 0.2, "converge": 0.5}) < score({"separation": 0.2, "converge": 1.0})
    assert score({}) == 1.0
