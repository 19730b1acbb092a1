"""What the judge expects a component to know of places that vehicles hover in, or have left."""

from dataclasses import replace

import numpy as np
import pytest

from agent.comms.unidentified_vehicles import REMEMBERED_S, UNMOVED_RANGE_M
from tests.recording.flights import straight_flight, wedge
from worldsim.judge.finding import InvariantTally
from worldsim.judge.radio_events import Partitioned
from worldsim.judge.tick import Tick
from worldsim.judge.verdict import Judge

PARTED_S, TURNS_AWAY_S, LEAVES_S, NEWS_S = 10.0, 20.0, 30.0, 20.0
SCENARIO = wedge(2, LEAVES_S + REMEMBERED_S + 2.0 * NEWS_S)
CUT = Partitioned(
    t_s=PARTED_S,
    agent=None,
    planned=True,
    number=1,
    groups=((0,), (1,)),
    parted="clean",
    bridge=(),
)


def breaches_s(away_m: float, near_m: float = 1.0) -> list[float]:
    """Judge two parted agents; return when I2 is violated [s].

    The first hovers in the apex until LEAVES_S. The second claims the place behind it for ever; it
    is ``near_m`` from the apex until TURNS_AWAY_S, and ``away_m`` from then on.
    """
    judge, found, violations = Judge(SCENARIO), [], 0
    for tick in straight_flight(SCENARIO):
        if tick.time_s == PARTED_S:
            judge.handle_event(CUT)
        judge.see(parted(tick, away_m if tick.time_s >= TURNS_AWAY_S else near_m))
        now = judge.invariants().get("I2", InvariantTally()).violations
        if now > violations and tick.time_s > PARTED_S:
            found.append(tick.time_s)
        violations = now
    return found


def parted(tick: Tick, away_m: float) -> Tick:
    first = (50.0, 0.0, 0.0) if tick.time_s >= LEAVES_S else (0.0, 0.0, 0.0)
    position = np.array([first, (-away_m, 0.0, 0.0)])
    return replace(tick, position=position, place=np.array([(0, 0), (0, 1)], dtype=np.int16))


def test_a_place_that_its_vehicle_left_within_sight_is_to_be_filled() -> None:
    found = breaches_s(UNMOVED_RANGE_M - 0.01)
    assert LEAVES_S < found[0] < LEAVES_S + NEWS_S


def test_a_place_that_its_vehicle_left_out_of_sight_need_not_be_filled_for_a_limited_time() -> None:
    found = breaches_s(2.5)
    ends_s = LEAVES_S + REMEMBERED_S
    assert ends_s < found[0] < ends_s + NEWS_S


def test_a_place_whose_vehicle_nobody_sensed_is_to_be_filled() -> None:
    """Nobody remembers it."""
    found = breaches_s(2.5, near_m=2.5)
    assert LEAVES_S < found[0] < LEAVES_S + NEWS_S


@pytest.mark.parametrize("away_m", [1.0, 2.5])
def test_a_place_in_which_a_vehicle_hovers_need_not_be_filled(away_m: float) -> None:
    assert all(time_s > LEAVES_S for time_s in breaches_s(away_m))
