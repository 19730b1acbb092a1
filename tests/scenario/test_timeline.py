"""The timeline by itself: what is due when, in which order, and what undoes it."""

from math import inf, pi

import pytest

from netem.link_keys import Conditions
from worldsim.scenario.file import parse
from worldsim.scenario.start import BoxStart
from worldsim.scenario.tables import Scenario
from worldsim.scenario.timeline import (
    Change,
    Heal,
    Holding,
    Joining,
    Order,
    Partition,
    Revival,
    Strike,
    Timeline,
)

QUEUE = "{ name = 'Q', vertices = ['V1'], shape = { kind = 'ray', direction = [0, 0, 1] } }"
LINE = f"{{ name = 'line', vertices = {{ V1 = [0, 0, 0] }}, queue = [{QUEUE}] }}"


def scenario(*events: str, radio: str = "") -> Scenario:
    told = "\n".join(f"[[event]]\n{event}" for event in events)
    text = f"duration_s = 60\nformation = {LINE}\n[fleet]\nagents = 4\n[netem]\n{radio}\n{told}\n"
    return parse(text)


def played(*events: str, radio: str = "") -> list[tuple[float, object]]:
    """Return every action with the time at which it comes, asked for each 0.1 s."""
    timeline = Timeline(scenario(*events, radio=radio))
    return [(k / 10, action) for k in range(601) for action in timeline.due(k / 10)]


def test_each_event_comes_once_at_its_time_whatever_order_the_file_has() -> None:
    later, sooner = "at_s = 5.0\nkill = [1, 'random:1']", "at_s = 0.3\nleave = ['vertex:V1']"
    assert played(later, sooner) == [
        (0.3, Strike(1, "leave", ("vertex:V1",))),
        (5.0, Strike(0, "kill", (1, "random:1"))),
    ]


def test_without_events_nothing_is_ever_due() -> None:
    assert Timeline(scenario()).next_s == inf
    assert played() == []


def test_what_was_slept_through_comes_at_once_in_order() -> None:
    timeline = Timeline(scenario("at_s = 2\nkill = [0]\nfor_s = 3", "at_s = 4\njoin = 2"))
    assert timeline.due(1.9) == []
    assert timeline.next_s == 2.0
    assert timeline.due(9.0) == [
        Strike(0, "kill", (0,)),
        Joining(1, 2, BoxStart()),
        Revival(0, ()),
    ]


def test_who_is_paused_resumes_by_itself_or_when_told() -> None:
    first, second = "at_s = 1\npause = ['vertex:V1']\nfor_s = 2", "at_s = 5\nresume = ['all']"
    assert played(first, second) == [
        (1.0, Holding(0, "pause", ("vertex:V1",))),
        (3.0, Holding(0, "resume", ())),
        (5.0, Holding(1, "resume", ("all",))),
    ]


def test_conditions_lie_over_each_other_and_go_in_any_order() -> None:
    first = "at_s = 1\nfor_s = 4\nnetem = { loss_percent = 50, delay_ms = 10 }"
    second = "at_s = 2\nfor_s = 1\nnetem = { loss_percent = 80, multihop = { delay_ms = 9 } }"
    actions = played(first, second, radio="range_m = 6\nloss_percent = 5")
    held = [
        (at_s, action.conditions.loss_percent, action.conditions.delay_ms, action.undone)
        for at_s, action in actions
        if isinstance(action, Change)
    ]
    assert held == [
        (1.0, 50.0, 10.0, False),
        (2.0, 80.0, 10.0, False),
        (3.0, 50.0, 10.0, True),
        (5.0, 5.0, None, True),
    ]
    last = actions[-1][1]
    assert isinstance(last, Change)
    assert last.conditions == Conditions(range_m=6.0, loss_percent=5.0)


def test_a_partition_ends_by_itself_by_heal_or_by_the_next() -> None:
    first, second = "at_s = 1\nfor_s = 5\npartition = [[0]]", "at_s = 2\npartition = [[1, 2]]"
    assert played(first) == [(1.0, Partition(((0,),))), (6.0, Heal())]
    assert played(first, second, "at_s = 8\nheal = true") == [
        (1.0, Partition(((0,),))),
        (2.0, Partition(((1, 2),))),
        (8.0, Heal()),
    ]


def placed(path):
    return (*path.waypoints[0], path.yaw)


def test_missions_keep_what_they_do_not_say() -> None:
    other = LINE.replace("'line'", "'other'")
    orders = [
        (action.kind, action.formation.name, placed(action.path))
        for _, action in played(
            "at_s = 1\nframe = { yaw_deg = 90 }",
            f"at_s = 2\nformation = {other}",
            "at_s = 3\nframe = { waypoints_m = [[1, 2, 3]] }",
        )
        if isinstance(action, Order)
    ]
    assert orders == [
        ("frame", "line", (0.0, 0.0, 0.0, pytest.approx(pi / 2))),
        ("formation", "other", (0.0, 0.0, 0.0, pytest.approx(pi / 2))),
        ("frame", "other", (1.0, 2.0, 3.0, pytest.approx(pi / 2))),
    ]
