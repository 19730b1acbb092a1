"""I5: an agent that goes back to an older mission is found at that tick; a new process may."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest

from tests.recording.flights import straight_flight, wedge
from worldsim.judge.run_events import Restarted, RunEvent
from worldsim.judge.verdict import Judge

SCENARIO = wedge(3, duration_s=2.0)
TICKS = list(straight_flight(SCENARIO))
NEW = 131072


def violations(
    keys: Mapping[int, int], events: Mapping[int, RunEvent] | None = None, down: range = range(0)
) -> list[int]:
    """Return the ticks at which I5 is violated. keys: agent 1's mission from a tick on."""
    judge, found, key = Judge(SCENARIO), [], 0
    for index, tick in enumerate(TICKS):
        if events and index in events:
            judge.handle_event(events[index])
        key = keys.get(index, key)
        alive = np.array([True, index not in down, True])
        before = judge.invariants()["I5"].violations
        judge.see(replace(tick, alive=alive, mission=np.array([0, key, 0])))
        if judge.invariants()["I5"].violations > before:
            found.append(index)
    assert judge.invariants()["I5"].ticks == len(TICKS)
    return found


def test_newer_missions_violate_nothing() -> None:
    assert violations({10: NEW, 20: 2 * NEW}) == []


@pytest.mark.parametrize("older", [0, -1])
def test_an_older_mission_or_none_violates_it_until_the_newer_one_is_back(older: int) -> None:
    assert violations({10: NEW, 20: older, 23: NEW}) == [20, 21, 22]


def test_a_pause_does_not_make_an_agent_forget() -> None:
    assert violations({10: NEW, 20: 0}, down=range(15, 25)) == list(range(25, len(TICKS)))


def test_a_new_process_knows_no_mission() -> None:
    restart = Restarted(t_s=TICKS[20].time_s, agent=1, planned=True, incarnation=1)
    assert violations({10: NEW, 20: -1}, {20: restart}, down=range(12, 20)) == []
