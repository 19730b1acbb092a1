"""A vehicle outside the team occupies a place where it hovers, not one that it passes (E18)."""

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


def occupied(velocity, seconds):
    """Places occupied by the ninth vehicle, which reaches the apex after so many seconds."""
    vehicles, phase = HoveringVehicles(1.0), Judge(SCENARIO).phases[0]
    places = frozenset()
    for tick in straight_flight(SCENARIO):
        if tick.time_s > seconds:
            return places
        position = tick.position.copy()
        position[-1] = np.array(velocity) * (tick.time_s - seconds)
        passing = replace(tick, position=position)
        vehicles.see(passing)
        places = vehicles.occupied_places(passing, phase, TEAM)
    return places


def test_a_hovering_vehicle_occupies_a_place():
    assert occupied((0.0, 0.0, 0.0), 4.0) == {APEX}


@pytest.mark.parametrize("speed", [0.15, 0.5])
def test_a_vehicle_that_flies_past_occupies_none(speed):
    assert occupied((speed, 0.0, 0.0), 4.0) == frozenset()


def test_a_vehicle_hovers_only_after_some_time_in_place():
    assert occupied((0.0, 0.0, 0.0), UNIDENTIFIED_AFTER_S - 0.1) == frozenset()
    assert occupied((0.0, 0.0, 0.0), UNIDENTIFIED_AFTER_S + 0.1) == {APEX}
