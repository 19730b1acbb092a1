"""Fleets without a ranging sensor are as fast as what they promise each other allows."""

import pytest

from worldsim.engine.virtual import fly
from worldsim.scenario.file import parse

FAST = """
duration_s = 14.0
[fleet]
agents = 6
start = { kind = "box", size_m = [5, 5, 2], spacing_m = 0.9 }
[formation]
file = "pyramidal-wedge"
[vehicle]
kind = "%s"
sensors = []
max_speed_mps = 2.0
[comms]
local_hz = 5.0
[netem]
loss_percent = 10.0
delay_ms = 50.0
"""


@pytest.mark.parametrize("kind", ["kinematic", "accelerating", "forward"])
def test_fast_vehicles_form_though_reports_of_them_are_old(kind: str) -> None:
    """Each could be 0.6 m farther on by now, but has promised less. They stood for ever once."""
    judge = fly(parse(FAST % kind)).loop.judge
    assert judge.phases[0].converge_s is not None
    assert judge.min_separation_m is not None
    assert judge.min_separation_m >= 0.25
