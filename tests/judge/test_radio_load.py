"""What rests on news in time is not evaluated while the radio's queues cannot carry the traffic."""

from dataclasses import replace
from math import inf

import pytest

from tests.recording.flights import straight_flight, wedge
from worldsim.engine.virtual import fly
from worldsim.judge.radio_load import RadioLoad
from worldsim.scenario.file import parse

LONGEST_S = 0.3
SATURATED = """
name = "saturated"
duration_s = 20.0
[fleet]
agents = 4
tick_hz = 50
[comms]
local_hz = 50
[formation]
name = "line"
vertices = {{ V1 = [0, 0, 0] }}
queue = [{{ name = "Q", vertices = ["V1"], shape = {{ kind = "ray", direction = [-1, 0, 0] }} }}]
[netem.local]
rate_kbit = {rate_kbit}
limit = {limit}
[expect]
"""


def overloaded(every_s: float, on_air_s: float, limit: int, longest_s: float = LONGEST_S) -> bool:
    """Return whether a queue is found overloaded; frames enter it every so many seconds."""
    load, left_s, sent, dropped, found = RadioLoad(), [0.0], 0, 0, False
    for tick in straight_flight(wedge(2, 20.0)):
        while sent * every_s <= tick.time_s:
            entered_s = sent * every_s
            if sum(each > entered_s for each in left_s) >= limit:
                dropped += 1
            else:
                left_s.append(max(left_s[-1], entered_s) + on_air_s)
            sent += 1
        flying = sum(each > tick.time_s for each in left_s)
        delivered = len(left_s) - flying
        packets = {"delivered": delivered, "dropped_queue": dropped, "in_flight": flying}
        found |= load.is_overloaded(replace(tick, packets=packets), longest_s)
    return found


@pytest.mark.parametrize("limit", [3, 1000])
@pytest.mark.parametrize("on_air_s", [0.06, 0.2])
def test_a_queue_that_drops_or_grows_is_overloaded(on_air_s: float, limit: int) -> None:
    assert overloaded(0.05, on_air_s, limit)


@pytest.mark.parametrize("on_air_s", [0.001, 0.03, 0.05])
def test_a_queue_that_carries_the_traffic_is_not(on_air_s: float) -> None:
    assert not overloaded(0.05, on_air_s, 3)


def test_a_radio_without_queues_is_never_overloaded() -> None:
    assert not overloaded(0.05, 0.2, 1000, inf)


def test_the_load_of_counters_that_come_once_a_second_is_found() -> None:
    load, found = RadioLoad(), []
    for tick in straight_flight(wedge(2, 10.0)):
        sent = 20 * int(tick.time_s)
        packets = {"delivered": sent // 2, "in_flight": sent - sent // 2}
        found.append(load.is_overloaded(replace(tick, packets=packets), LONGEST_S))
    assert not any(found[:60])
    assert all(found[70:])


@pytest.mark.parametrize(
    ("rate_kbit", "limit", "evaluated"), [(200, 1000, True), (20, 1000, False), (20, 5, False)]
)
def test_a_saturated_radio_is_not_blamed_on_the_team(
    rate_kbit: int, limit: int, evaluated: bool
) -> None:
    flight = fly(parse(SATURATED.format(rate_kbit=rate_kbit, limit=limit)))
    found = flight.loop.judge.invariants()
    assert {"I1", "I8"} <= set(found)
    assert {"I2", "I3", "I7"}.isdisjoint(found) is not evaluated
    assert found["I4"].ticks > 900 or not evaluated
