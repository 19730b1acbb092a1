"""A vehicle outside the team occupies a place where it hovers, not one that it passes (E18)."""

from dataclasses import replace

import numpy as np
import pytest

from agent.comms.unidentified_vehicles import UNIDENTIFIED_AFTER_S
from agent.messages import Place
from tests.recording.flights import straight_flight, wedge
from worldsim.judge.finding import InvariantTally
from worldsim.judge.hovering_vehicles import HoveringVehicles
from worldsim.judge.run_events import Killed, Restarted
from worldsim.judge.tick import Tick
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


KILLED_S = 10.0


def survivor_flight(place: Place, metres: float, restarted: bool = False) -> InvariantTally:
    """Judge I2 of two agents of which the vertex agent dies at its place, and hovers there.

    The survivor claims a place from then on, and hovers so far from the dead vehicle.
    """
    judge = Judge(wedge(2, 30.0))
    killed = Killed(t_s=KILLED_S, agent=0, planned=True)
    again = Restarted(t_s=KILLED_S + 1.0, agent=1, planned=True)
    for tick in straight_flight(wedge(2, 30.0)):
        if tick.time_s == KILLED_S:
            judge.handle_event(killed)
        if restarted and tick.time_s == again.t_s:
            judge.handle_event(again)
        judge.see(alone(tick, place, metres) if tick.time_s >= KILLED_S else tick)
    return judge.invariants().get("I2", InvariantTally())


def alone(tick: Tick, place: Place, metres: float) -> Tick:
    """Return the tick without its first agent; the second claims a place, so far from it."""
    position = np.array([[0.0, 0.0, 0.0], [-metres, 0.0, 0.0]])
    alive = np.array([False, True])
    places = np.array([APEX, place], dtype=np.int16)
    return replace(tick, position=position, alive=alive, place=places)


def test_the_last_survivor_that_stays_in_an_occupied_place_is_judged() -> None:
    assert survivor_flight(APEX, 0.6).violations > 100


def test_the_last_survivor_that_takes_the_next_place_violates_nothing() -> None:
    found = survivor_flight(Place(0, 1), 1.0)
    assert found.ticks > 100
    assert found.violations == 0


def test_a_restarted_survivor_that_has_heard_nobody_is_not_judged() -> None:
    """It has no reason to take what it senses for the vehicle of a member."""
    before_the_death = survivor_flight(APEX, 1.9).ticks
    assert survivor_flight(APEX, 0.6, restarted=True).ticks == before_the_death


@pytest.mark.parametrize(
    ("away_m", "noise_m", "doubtful"),
    [(0.45, 0.0, False), (0.501, 0.0, True), (0.55, 0.0, False), (0.45, 0.1, True)],
)
def test_a_vehicle_half_a_spacing_from_a_place_may_or_may_not_take_it(
    away_m: float, noise_m: float, doubtful: bool
) -> None:
    """In doubt, what the agents claim counts: here nobody claims the apex, so it is taken."""
    vehicles, phase = HoveringVehicles(1.0, noise_m), Judge(SCENARIO).phases[0]
    for tick in straight_flight(SCENARIO):
        position = tick.position.copy()
        position[-1] = (0.0, 0.0, away_m)  # the apex stands in the origin
        place = tick.place.copy()
        place[:, 1] = np.maximum(place[:, 1], 1)
        seen = replace(tick, position=position, place=place)
        vehicles.see(seen)
        if tick.time_s > UNIDENTIFIED_AFTER_S + 0.1:
            break
    assert vehicles.is_doubtful(seen, phase, TEAM) == doubtful
    taken = doubtful or away_m < 0.5
    assert vehicles.places_left_out(seen, phase, TEAM) == ({APEX} if taken else frozenset())


@pytest.mark.parametrize("aside_m", [0.0, 0.3])
def test_an_agent_that_stands_in_its_place_keeps_it_whatever_hovers_beside_it(
    aside_m: float,
) -> None:
    """Where two places are near to each other, one dead vehicle would take both."""
    vehicles, phase = HoveringVehicles(1.0), Judge(SCENARIO).phases[0]
    for tick in straight_flight(SCENARIO):
        position = tick.position.copy()
        position[0], position[-1] = (aside_m, 0.0, 0.0), (0.0, 0.0, 0.4)  # the apex's own agent
        seen = replace(tick, position=position)
        vehicles.see(seen)
        if tick.time_s > UNIDENTIFIED_AFTER_S + 0.1:
            break
    assert tuple(seen.place[0]) == APEX
    kept = vehicles.places_left_out(seen, phase, TEAM)
    assert kept == ({APEX} if aside_m else frozenset())
