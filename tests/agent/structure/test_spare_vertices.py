"""A team that has become smaller than the number of vertices fills those that its layout names."""

import pytest

from worldsim.engine.virtual import fly
from worldsim.scenario.file import parse

FOUR_VERTICES = """
name = "spare-vertices"
duration_s = 35.0
seed = {seed}
[fleet]
agents = 4
[fleet.start]
kind = "list"
positions_m = [[0.1, 0, 0], [-1.2, 0, 0], [0, 1.5, 0.1], [0, -1.5, 0]]
[formation]
name = "three-queues"
vertices = {{ V1 = [0, 0, 0], V2 = [0, 2, 0], V3 = [0, -2, 0], V4 = [-1, 0, 0] }}
[[formation.queue]]
name = "Q1"
vertices = ["V1", "V4"]
shape = {{ kind = "ray", direction = [-1, 0, 0] }}
[[formation.queue]]
name = "Q2"
vertices = ["V2"]
shape = {{ kind = "ray", direction = [-1, 0, 0] }}
[[formation.queue]]
name = "Q3"
vertices = ["V3"]
shape = {{ kind = "ray", direction = [-1, 0, 0] }}
[netem]
{netem}
[[event]]
at_s = 10.0
leave = ["vertex:{left}"]
"""


@pytest.mark.parametrize("netem", ["", "loss_percent = 30\ndelay_ms = 100"])
@pytest.mark.parametrize("left", ["V2", "V3"])
def test_the_leader_of_a_vertex_that_is_to_stay_empty_fills_another(left: str, netem: str) -> None:
    """Four vertices, three agents left: V4 on the first queue stays empty."""
    scenario = parse(FOUR_VERTICES.format(seed=3, left=left, netem=netem))
    judge = fly(scenario).loop.judge
    (recovery,) = judge.recoveries
    assert recovery.reformed_s is not None
    assert recovery.reformed_s < 12.0
    assert judge.invariants()["I2"].violations == 0


def test_who_is_cut_off_alone_keeps_its_vertex() -> None:
    """All stand where they stood when they hear each other again."""
    cut_off = """
[[event]]
at_s = 10.0
for_s = 15.0
partition = [[0], [1], [2], [3]]
"""
    text = FOUR_VERTICES.format(seed=3, left="V2", netem="").partition("[[event]]")[0]
    judge = fly(parse(text + cut_off)).loop.judge
    (recovery,) = judge.recoveries
    assert recovery.reformed_s is not None
    assert recovery.reformed_s < 1.0
    invariants = judge.invariants()
    assert invariants["I2"].ticks > 100
    assert invariants["I2"].violations == invariants["I6"].violations == 0


def test_the_leader_of_a_vertex_that_a_dead_vehicle_takes_fills_another() -> None:
    """Two agents left, V2 taken: they stand in V1 and V3."""
    killed = """
[[event]]
at_s = 10.0
kill = ["vertex:V2", "vertex:V4"]
"""
    text = FOUR_VERTICES.format(seed=3, left="V2", netem="").partition("[[event]]")[0]
    judge = fly(parse(text + killed)).loop.judge
    (recovery,) = judge.recoveries
    assert recovery.reformed_s is not None
    assert judge.invariants()["I2"].violations == 0
