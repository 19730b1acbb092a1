"""What a sweep flies: the grid that its texts mean, and what they may not say."""

import pytest

from worldsim.sweep.plan import Axis, FlightKey, Plan, PlanError, axis_of


def test_commas_within_brackets_and_quotes_belong_to_a_value() -> None:
    axis = axis_of('fleet.start.centre_m=[0, 0, 0],[1,2,3],"a,b"')
    assert axis.values == ("[0, 0, 0]", "[1,2,3]", '"a,b"')
    assert axis.numbers is None


def test_numbers_are_numbers_and_flags_are_not() -> None:
    assert axis_of("netem.loss_percent = 0, 30.5").numbers == (0.0, 30.5)
    assert axis_of("a.b=true,false").numbers is None


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("netem.loss_percent", "write it as netem.loss_percent=0,30,50"),
        ("netem.loss_percent=", "has no value, or an empty one"),
        ("netem.loss_percent=1,,2", "has no value, or an empty one"),
        ("netem.loss_percent=50,0,50.0", "has the value 50.0 twice"),
        ("seed=1,2", "is varied by --seeds"),
        ("name=a,b", "changes no flight"),
    ],
)
def test_what_is_no_axis_is_refused(text: str, says: str) -> None:
    with pytest.raises(PlanError, match=says):
        axis_of(text)


def test_a_key_is_varied_once() -> None:
    axis = Axis("a.b", ("1",))
    with pytest.raises(PlanError, match="is varied twice"):
        Plan((axis, axis), range(2))


def test_flights_come_seed_by_seed() -> None:
    plan = Plan((Axis("a", ("1", "2")), Axis("b", ("x", "y", "z"))), range(4, 6))
    flights = list(plan.flights())
    assert len(flights) == len(plan) == len(set(flights)) == 12
    assert flights[:6] == [FlightKey(cell, 4) for cell in range(6)]
    assert [tuple(plan.settings(cell).values()) for cell in range(6)] == plan.cells
    assert plan.settings(4) == {"a": "2", "b": "y"}
    assert list(plan.settings(4)) == ["a", "b"]
