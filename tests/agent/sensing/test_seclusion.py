"""A secluded agent flies on slowly, but never where somebody could be whom it does not sense."""

from math import dist

import pytest

from agent.sensing.seclusion import AGREED_S, PROBING_MPS, Seclusion
from tests.agent.comms.builders import heard_beacon
from tests.agent.sensing.test_sensor_health import observation
from worldsim.engine.virtual import fly
from worldsim.scenario.file import parse

TICK_HZ = 20.0
LONG = round(2.0 * AGREED_S * TICK_HZ)


def probes(
    others, *, until: int = LONG, sensed=(), heard=lambda tick: True, own=lambda tick: 0.0
) -> bool:
    """Return whether an agent may fly after some ticks. others: (x [m], from tick on) by id."""
    seclusion = Seclusion(0.5)
    for tick in range(until):
        now = observation(tick, own(tick), vehicles=sensed)
        reports = [
            heard_beacon(each, tick, now.time_s, at=(x(tick) if callable(x) else x, 0.0, 0.0))
            for each, x in others.items()
        ]
        seclusion.update(now, reports if heard(tick) else (), met=False)
    return seclusion.probing_mps == PROBING_MPS


def test_it_flies_on_where_sensor_and_all_reports_agree_that_nobody_is_near() -> None:
    assert probes({2: 3.0, 3: 5.0})
    assert not probes({2: 3.0, 3: 5.0}, until=round(0.5 * AGREED_S * TICK_HZ))


@pytest.mark.parametrize(
    ("others", "more"),
    [
        ({}, {}),
        ({2: 3.0, 3: 1.9}, {}),
        ({2: 3.0}, {"sensed": ((1.0, 0.0, 0.0),)}),
        ({2: 3.0}, {"heard": lambda tick: tick < LONG - 12}),
        ({2: lambda tick: 3.0 + 2.0 * (tick > 5)}, {}),
        ({2: 3.0}, {"own": lambda tick: -5.0 * (tick > 5)}),
    ],
    ids=["nobody heard", "one near", "one sensed", "one silent", "a report jumps", "it jumps"],
)
def test_it_stands_where_somebody_may_be_near(others, more) -> None:
    assert not probes(others, **more)


LEFT_ALONE = """
name = "left-alone"
duration_s = 75.0
[fleet]
agents = 2
start = {{ kind = "list", positions_m = [[0, 0, 0], [1, 0, 0]] }}
[formation]
name = "line"
vertices = {{ V1 = [6, 0, 0] }}
queue = [{{ name = "Q1", vertices = ["V1"], shape = {{ kind = "ray", direction = [1, 0, 0] }} }}]
[[event]]
at_s = 0.1
for_s = {for_s}
sensor = {{ agents = [0], mode = "silent" }}
"""


@pytest.mark.parametrize(("for_s", "comes"), [(4.0, True), (74.0, False)])
def test_an_agent_left_alone_comes_back_but_not_near_with_a_dead_sensor(
    for_s: float, comes: bool
) -> None:
    loop = fly(parse(LEFT_ALONE.format(for_s=for_s))).loop
    here, there = loop.world.positions()
    assert (loop.judge.phases[0].converge_s is not None) == comes
    assert here is not None
    assert there is not None
    assert comes or 1.7 < dist(here, there) < 2.3
