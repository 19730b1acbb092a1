"""Overload: when it is reported, how simulated time is slowed, and when a run ends."""

from collections.abc import Callable, Iterator
from itertools import pairwise

import pytest

from worldsim.fleet.late_under_attack import LateUnderAttack, attackers
from worldsim.fleet.overload import (
    LEAST_FACTOR,
    LOOK_EVERY_S,
    LateShare,
    LateSpells,
    OnOverload,
    Overload,
    percent,
)

TICKS = 90
"""Ticks between two looks: nine agents, 20 a second."""
LateAt = Callable[[float, float], float]
"""The share of late ticks, by wall time [s] and speed."""


def reports(overload: Overload, seconds: float, late: LateAt, from_s: float = 0.0) -> Iterator[str]:
    """Yield what is reported in ``seconds`` of wall time."""
    for number in range(1, round(seconds / LOOK_EVERY_S) + 1):
        now_s = from_s + number * LOOK_EVERY_S
        share = late(now_s, overload.speed)
        report = overload.note(now_s, TICKS, round(TICKS * share))
        if report is not None:
            yield report


def always(share: float) -> LateAt:
    return lambda now_s, speed: share


def above(capacity: float, share: float = 0.4) -> LateAt:
    """Return the lateness of a host that keeps up to a speed."""
    return lambda now_s, speed: share if speed > capacity else 0.0


def test_the_share_is_that_of_the_last_seconds() -> None:
    share = LateShare()
    assert share.of_last(2.0) == 0.0
    for second in range(1, 21):
        share.add(float(second), 10, 10 if second <= 18 else 0)
    assert (share.of_last(2.0), share.of_last(10.0)) == (0.0, 0.8)
    assert (percent(0.1234), percent(0.0123), percent(1.0)) == ("12 %", "1.2 %", "100 %")


def test_an_intruder_is_named_where_ticks_are_late_under_its_attack() -> None:
    under = LateUnderAttack()
    for late, intruders in ((0, [1]), (5, []), (15, [3])):
        under.note(late, intruders)
    assert str(under) == "75 % of them while intruder-3 attacked the router"
    assert str(LateUnderAttack()) == ""
    assert attackers([]) == ""
    assert attackers([3]) == "intruder-3 attacks the router"
    spells = LateSpells()
    for second in range(4):
        attack = attackers([0, 3]) if second >= 2 else ""
        spells.add(float(second), 100, 30 if attack else 0, float(second), attack)
    assert str(spells).endswith(", at 3.0 s, while intruder-0, intruder-3 attack the router")


def test_a_spell_of_late_ticks_excuses_what_is_violated_in_it_and_nothing_else() -> None:
    spells = LateSpells()
    for second in range(40):
        slow = 10 <= second < 12
        spells.add(float(second), 100, 30 if slow else 0, 2.0 * second)
        if second == 5:
            spells.note({"I4": 1, "I7": 0})
        if second == 11:
            spells.note({"I4": 1, "I7": 3})
        if second == 35:
            spells.note({"I4": 1, "I7": 3, "I2": 1})
    assert spells.violated_in_time == {"I4", "I2"}
    assert str(spells) == (
        "the host was too slow for a while: 30 % of the ticks of 2 s were late, at 22.0 s"
    )
    assert not str(LateSpells())


def test_an_overload_is_reported_at_once_with_the_remedy_and_only_once() -> None:
    overload = Overload(1.0, "go")
    told = list(reports(overload, 60.0, always(0.12)))
    assert told == [
        "late: 12 % of the ticks in the last 2 s;"
        " use --lockstep, fewer agents or a lower --speed, or --on-overload slow"
    ]
    assert (overload.speed, overload.least_speed, overload.abort_reason) == (1.0, 1.0, None)


def test_the_next_overload_is_reported_again() -> None:
    overload = Overload(1.0, "go")
    assert len(list(reports(overload, 59.0, lambda now_s, _: 0.2 * (now_s % 30.0 < 10.0)))) == 2


def test_few_late_ticks_are_reported_when_they_last() -> None:
    assert list(reports(Overload(1.0, "go"), 9.0, always(0.02))) == []
    (told,) = reports(Overload(1.0, "go"), 30.0, always(0.02))
    assert told.startswith("late: 2.2 % of the ticks in the last 10 s; ")


@pytest.mark.parametrize("policy", ["go", "abort"])
def test_a_short_hiccup_is_no_overload(policy: OnOverload) -> None:
    overload = Overload(1.0, policy)
    assert list(reports(overload, 60.0, lambda now_s, _: 0.1 * (now_s == 20.0))) == []
    assert overload.abort_reason is None


@pytest.mark.parametrize("requested", [1.0, 4.0])
@pytest.mark.parametrize("share", [0.05, 0.4])
def test_time_is_slowed_until_the_ticks_are_in_time(requested: float, share: float) -> None:
    overload, capacity = Overload(requested, "slow"), 0.55 * requested
    told = list(reports(overload, 20.0, above(capacity, share)))
    assert told == [
        f"late: {percent(round(TICKS * share) / TICKS)} of the ticks; simulated time is slowed"
    ]
    assert overload.slowed
    assert 0.4 * requested <= overload.least_speed <= capacity


def test_a_step_of_the_speed_is_bounded() -> None:
    overload, speeds = Overload(1.0, "slow"), [1.0]

    def late(now_s: float, speed: float) -> float:
        speeds.append(speed)
        return 1.0 if now_s % 40.0 < 5.0 else 0.0

    list(reports(overload, 120.0, late))
    steps = [now / then for then, now in pairwise(speeds)]
    assert min(steps) == 0.5
    assert max(steps) == pytest.approx(1.1)
    assert min(speeds) == overload.least_speed == LEAST_FACTOR


def test_the_speed_recovers_and_says_so() -> None:
    overload = Overload(2.0, "slow")
    told = list(reports(overload, 60.0, lambda now_s, _: 0.5 * (now_s < 2.0)))
    assert told[1:] == ["the ticks are in time again, at 2 x real time"]
    assert (overload.speed, overload.slowed) == (2.0, False)
    assert overload.least_speed == 2.0 * 0.5**3


def test_near_its_limit_a_host_is_pushed_over_it_ever_more_rarely() -> None:
    overload, late_at_s = Overload(1.0, "slow"), []

    def late(now_s: float, speed: float) -> float:
        if speed <= 0.9:
            return 0.0
        late_at_s.append(now_s)
        return 0.05

    list(reports(overload, 600.0, late))
    gaps = [after - before for before, after in pairwise(late_at_s)]
    assert len(late_at_s) < 25
    assert gaps[-1] > 4.0 * gaps[0]


def test_a_host_that_was_at_its_limit_for_long_recovers_within_two_minutes() -> None:
    overload = Overload(1.0, "slow")
    list(reports(overload, 300.0, above(0.3)))
    assert overload.speed <= 0.3
    list(reports(overload, 120.0, always(0.0), from_s=300.0))
    assert overload.speed == 1.0


def test_where_the_least_speed_is_not_enough_it_is_said_once() -> None:
    overload = Overload(1.0, "slow")
    told = list(reports(overload, 60.0, always(0.5)))
    assert told[1:] == [
        "late even at the least speed, 0.1 x real time;"
        " use --lockstep, fewer agents or a lower --speed"
    ]
    assert overload.least_speed == LEAST_FACTOR


@pytest.mark.parametrize(("requested", "least"), [(0.05, 0.01), (0.01, 0.01), (0.005, 0.005)])
def test_a_low_speed_is_not_lowered_to_a_standstill(requested: float, least: float) -> None:
    overload = Overload(requested, "slow")
    list(reports(overload, 60.0, always(0.5)))
    assert overload.least_speed == pytest.approx(least)


def test_an_overload_ends_the_run_with_its_reason() -> None:
    overload = Overload(1.0, "abort")
    (told,) = reports(overload, 10.0, always(0.3))
    assert told.startswith("late: 30 % of the ticks in the last 2 s; the run ends")
    assert overload.abort_reason == (
        "overload (late: 30 % of the ticks in the last 2 s; --on-overload abort)"
    )
    assert overload.least_speed == 1.0


def test_a_time_without_ticks_changes_nothing() -> None:
    overload = Overload(1.0, "slow")
    assert overload.note(5.0, 0, 0) is None
    assert overload.note(5.1, TICKS, TICKS) is not None
