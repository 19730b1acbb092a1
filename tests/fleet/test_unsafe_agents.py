"""Safety on a host that makes agents late: whether those that broke it were on time."""

import numpy as np
import pytest

from tests.fleet.test_pacing import command
from worldsim.fleet.pacing import LatenessCounter
from worldsim.fleet.unsafe_agents import UnsafeAgents
from worldsim.judge.verdict import Figures


def figures(separation: list[float], obstacle: list[float] | None = None) -> Figures:
    return Figures(
        separation=np.array(separation),
        slot_error=np.zeros(len(separation)),
        converged=False,
        obstacle_distance=np.array(obstacle) if obstacle is not None else None,
    )


@pytest.mark.parametrize(
    ("separation", "late", "broken"),
    [
        ([0.3, 0.3, 0.3], set(), False),
        ([0.2, 0.2, 0.3], set(), True),
        ([0.2, 0.2, 0.3], {2}, True),
        ([0.2, 0.2, 0.3], {1}, False),
        ([0.2, 0.2, 0.3], {0, 1}, False),
        ([float("nan"), 0.2, 0.2], {0}, True),
    ],
)
def test_two_that_come_too_near_are_excused_where_one_was_late(
    separation: list[float], late: set[int], broken: bool
) -> None:
    unsafe = UnsafeAgents(0.25, 0.5)
    unsafe.see(None, lambda _: True)
    unsafe.see(figures(separation), lambda agent: agent not in late)
    assert unsafe.on_time == broken


@pytest.mark.parametrize(("late", "broken"), [(set(), True), ({1}, True), ({0}, False)])
def test_one_at_an_obstacle_is_excused_where_it_was_late(late: set[int], broken: bool) -> None:
    unsafe = UnsafeAgents(0.25, 0.5)
    unsafe.see(figures([9.0, 9.0], [0.4, 3.0]), lambda agent: agent not in late)
    assert unsafe.on_time == broken


def test_the_latest_agent_is_named_and_is_on_time_again_after_a_while() -> None:
    lateness = LatenessCounter(3)
    assert lateness.latest is None
    for slot in (0, 4, 8, 12):
        lateness.observe(0, slot, command(slot - 4) if slot else None)
        lateness.observe(1, slot, command(0) if slot else None)
    assert lateness.latest == (1, 2 / 3)
    assert lateness.on_time_since(0, 0)
    assert not lateness.on_time_since(1, 12)
    assert lateness.on_time_since(1, 13)
