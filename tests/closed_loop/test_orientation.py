"""Orientation along a queue: held where the vehicle can, taken up where its slot rests."""

import pytest

from worldsim.engine.virtual import VirtualFleet
from worldsim.scenario.file import parse
from worldsim.scenario.rules import warnings_for

LINE = """
duration_s = 28.0
[fleet]
agents = 4
start = {{ kind = "box", size_m = [3, 3, 1], spacing_m = 0.6 }}
[vehicle]
kind = "{kind}"
[netem]
range_m = 6.0
[formation]
name = "line"
vertices = {{ V1 = [0, 0, 0] }}
[[formation.queue]]
name = "tail"
vertices = ["V1"]
shape = {{ kind = "ray", direction = [-1, 0, 0] }}
orientation = {{ yaw_deg = {yaw_deg} }}
[frame]
waypoints_m = [[0, 0, 0], [1.5, 0, 0], [3, 0, 0]]
speed_mps = 0.3
start_s = 10.0
pauses_s = [0, 5, 0]
[expect]
attitude_within_deg = 15.0
"""
YAW_KEY = ["formation.queue[0].orientation.yaw_deg"]
RESTS_S, FLIES_S, PAUSES_S, ENDS_S = 9.9, 13.0, 19.9, 28.0


@pytest.mark.parametrize(
    ("kind", "yaw_deg", "held"),
    [
        ("kinematic", 30, True),
        ("kinematic", 90, False),
        ("accelerating", -40, True),
        ("accelerating", 180, False),
        ("forward", 0, True),
        ("forward", 30, False),
    ],
)
def test_the_yaw_is_held_within_the_cone_and_taken_up_where_the_slot_rests(kind, yaw_deg, held):
    scenario = parse(LINE.format(kind=kind, yaw_deg=yaw_deg))
    fleet = VirtualFleet(scenario)
    judge, error_deg = fleet.loop.judge, {}
    for until_s in (RESTS_S, FLIES_S, PAUSES_S, ENDS_S):
        while fleet.loop.world.time_s < until_s:
            fleet.slot()
        error_deg[until_s] = judge.attitude_error_deg
    assert max(error_deg[at_s] for at_s in (RESTS_S, PAUSES_S, ENDS_S)) < 1.0
    assert (error_deg[FLIES_S] < 1.0) is held
    assert judge.phases[0].residual_m < 0.02
    (row,) = [row for row in judge.expectations() if row.name == "attitude_within_deg"]
    assert row.held is held
    assert [each.key for each in warnings_for(scenario)] == YAW_KEY * (not held)
