"""The safety filter by promises: what one vehicle promises, and when it stands."""

import pytest

from agent.comms.whereabouts import PROMISE_S, VehicleReport
from agent.guidance.promise_filter import LEAST_CAP_MPS, PromiseFilter
from agent.guidance.sight import Braking

D_OB, MAX_SPEED, TICK_S = 0.25, 0.5, 0.05
NEAR = [VehicleReport((0.4, 0.0, 0.0), age_s=0.0, speed_cap=0.5)]
AT_REST = (0.0, 0.0, 0.0)


def promises(**options):
    return PromiseFilter(D_OB, MAX_SPEED, Braking(TICK_S), **options)


def test_a_promise_limits_the_speed_for_three_seconds():
    filtered = promises()
    low = filtered.promise(0.0, 0.0, NEAR)
    assert low < MAX_SPEED
    for tick in range(1, 61):
        filtered.promise(tick * TICK_S, low, [])
        assert filtered.speed_limit == low
    filtered.promise(PROMISE_S + TICK_S, low, [])
    assert filtered.speed_limit == MAX_SPEED


def test_a_slow_promise_of_another_allows_a_faster_one():
    """A ball grows at the speed that was promised, not at the speed that the fleet may fly."""
    slow, fast = (
        promises().promise(0.0, 0.0, [VehicleReport((0.6, 0.0, 0.0), age_s=0.5, speed_cap=cap)])
        for cap in (0.05, 0.5)
    )
    assert (slow, fast) == (pytest.approx(0.325 / 1.3), pytest.approx(0.1 / 1.3))


def test_a_promise_covers_the_command_that_is_still_flown():
    filtered = promises()
    filtered.promise(0.0, 0.0, [])
    filtered.command(0.0, 0.4)
    assert filtered.promise(TICK_S, 0.3, NEAR) == 0.4
    assert filtered.speed_limit < 0.4


def test_a_restarted_agent_keeps_what_an_earlier_process_may_have_promised():
    filtered = promises(restarted=True)
    filtered.promise(0.0, 0.0, [])
    assert filtered.speed_limit == LEAST_CAP_MPS
    filtered.promise(PROMISE_S + TICK_S, 0.0, [])
    assert filtered.speed_limit == MAX_SPEED


@pytest.mark.parametrize(
    ("away_m", "age_s", "cap", "stands"),
    [
        (2.0, 0.1, 0.5, False),
        (0.4, 0.1, 0.5, False),
        (0.4, 0.5, 0.5, True),
        (0.4, 0.5, 0.05, False),
        (2.0, PROMISE_S, 0.05, False),
        (2.0, PROMISE_S + 3.2, 0.05, True),
        (10.0, 30.0, 0.05, True),
    ],
)
def test_a_vehicle_stands_where_another_may_be_too_near(away_m, age_s, cap, stands):
    filtered = promises()
    reports = [VehicleReport((0.0, away_m, 0.0), age_s, cap)]
    filtered.promise(0.0, 0.0, reports)
    assert filtered.must_stand(AT_REST, reports) == stands


def test_a_vehicle_that_brakes_slowly_stands_earlier():
    reports = [VehicleReport((1.5, 0.0, 0.0), age_s=0.5, speed_cap=0.5)]
    for decel_mps2, stands in ((float("inf"), False), (0.2, True)):
        filtered = PromiseFilter(D_OB, MAX_SPEED, Braking(TICK_S, decel_mps2))
        filtered.promise(0.0, 0.5, reports)
        assert filtered.must_stand((0.5, 0.0, 0.0), reports) == stands
