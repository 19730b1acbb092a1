"""An agent gets past a vehicle that stands in its way, however near its sensor lets it come."""

import pytest

from worldsim.engine.virtual import fly
from worldsim.scenario.file import parse

IN_THE_WAY = """
name = "past-the-dead"
duration_s = 40.0
seed = {seed}
[fleet]
agents = 2
[fleet.start]
kind = "list"
positions_m = [[0, 0, 0], [-2, 0.01, 0.01]]
[formation]
name = "line"
vertices = {{ V1 = [3, 0, 0] }}
queue = [{{ name = "Q", vertices = ["V1"], shape = {{ kind = "ray", direction = [1, 0, 0] }} }}]
[vehicle]
kind = "forward"
[sensor.proximity]
noise_m = 0.02
[[event]]
at_s = 0.1
kill = [0]
[expect]
converge_within_s = 30.0
min_separation_m = 0.25
"""


@pytest.mark.parametrize("seed", [28, 45, 57])
def test_a_vehicle_that_only_flies_forward_backs_off_from_one_that_stands(seed: int) -> None:
    """Held within the margin for noise, it may only fly away: no way round begins there."""
    judge = fly(parse(IN_THE_WAY.format(seed=seed))).loop.judge
    assert [each.name for each in judge.expectations() if not each.held] == []
