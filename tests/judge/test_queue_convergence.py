"""Queues converge one by one, before the whole formation does."""

from dataclasses import replace

import numpy as np
import pytest

from tests.recording.flights import straight_flight, wedge
from worldsim.judge.verdict import Judge
from worldsim.scenario.tables import CONVERGED_M

AGENTS = 9
SCENARIO = wedge(AGENTS, duration_s=12.0)


def judged(change=lambda tick: tick):
    judge = Judge(SCENARIO)
    figures = [judge.see(change(tick)) for tick in straight_flight(SCENARIO)]
    return judge, figures


def late(tick):
    """The last agent stays 1 m above its path for 6 s."""
    position = tick.position.copy()
    position[-1, 2] += 1.0 if tick.time_s < 6.0 else 0.0
    return replace(tick, position=position)


def test_a_queue_converges_before_the_whole_formation_does():
    judge, _ = judged(late)
    (queues,) = judge.queues
    last = next(iter(straight_flight(SCENARIO))).place[-1, 0]
    assert queues.names == ("Q0", "Q1", "Q2", "Q3")
    assert queues.converge_s[last] == judge.phases[0].converge_s == pytest.approx(6.0)
    others = [at_s for queue, at_s in enumerate(queues.converge_s) if queue != last]
    assert max(others) < 4.0


def test_a_residual_is_the_largest_error_in_a_queue_with_its_shared_vertex():
    _, figures = judged()
    places = next(iter(straight_flight(SCENARIO))).place
    apex = int(np.flatnonzero(np.all(places == 0, axis=1))[0])
    for queue in range(4):
        members = [*np.flatnonzero((places[:, 0] == queue) & (places[:, 1] > 0)), apex]
        assert figures[0].queue_residual[queue] == max(figures[0].slot_error[members])


def test_no_queue_converges_while_an_agent_has_no_place():
    def unplaced(tick):
        place = tick.place.copy()
        place[-1] = -1
        return replace(tick, place=place)

    judge, figures = judged(unplaced)
    assert judge.queues[0].converge_s == [None] * 4
    assert np.nanmax(figures[-1].queue_residual) < CONVERGED_M
