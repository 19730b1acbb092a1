"""A vehicle of no member takes a place where it stands, and none that it flies past (E18)."""

from dataclasses import replace

import numpy as np
import pytest

from agent.comms.unidentified_vehicles import UNIDENTIFIED_AFTER_S
from agent.messages import Place
from tests.recording.flights import straight_flight, wedge
from worldsim.judge.hovering_vehicles import HoveringVehicles
from worldsim.judge.verdict import Judge

SCENARIO = wedge(9)
TEAM = list(range(8))
APEX = Place(0, 0)


def blocked(velocity, seconds):
    """What is taken from the first eight as the ninth passes the apex, after so many seconds."""
    bodies, phase = HoveringVehicles(1.0), Judge(SCENARIO).phases[0]
    taken = frozenset()
    for tick in straight_flight(SCENARIO):
        if tick.time_s > seconds:
            return taken
        position = tick.position.copy()
        position[-1] = np.array(velocity) * (tick.time_s - seconds)
        passing = replace(tick, position=position)
        bodies.see(passing)
        taken = bodies.blocked(passing, phase, TEAM)
    return taken


def test_who_stands_there_takes_a_place():
    assert blocked((0.0, 0.0, 0.0), 4.0) == {APEX}


@pytest.mark.parametrize("speed", [0.15, 0.5])
def test_who_flies_past_takes_none(speed):
    assert blocked((speed, 0.0, 0.0), 4.0) == frozenset()


def test_nobody_is_known_to_stand_before_it_did_so_for_a_while():
    assert blocked((0.0, 0.0, 0.0), UNIDENTIFIED_AFTER_S - 0.1) == frozenset()
    assert blocked((0.0, 0.0, 0.0), UNIDENTIFIED_AFTER_S + 0.1) == {APEX}
