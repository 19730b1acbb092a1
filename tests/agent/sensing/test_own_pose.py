"""A measured position jumps where the vehicle cannot have flown."""

from hypothesis import given, settings
from hypothesis import strategies as st

from agent.config import Vehicle
from agent.sensing.own_pose import JUMP_M, OwnPose

SLOT_S = 0.0125


@settings(derandomize=True, deadline=None)
@given(st.lists(st.tuples(st.integers(1, 400), st.floats(0, 5)), min_size=1, max_size=20))
def test_only_what_cannot_be_flown_is_a_jump(steps):
    pose = OwnPose(Vehicle(max_speed_mps=0.3, max_climb_mps=0.4), SLOT_S)
    slot, x = 0, 0.0
    assert not pose.jumps(slot, (900.0, 0.0, 0.0))
    pose = OwnPose(Vehicle(max_speed_mps=0.3, max_climb_mps=0.4), SLOT_S)
    pose.jumps(slot, (x, 0.0, 0.0))
    for slots, beyond_m in steps:
        slot, x = slot + slots, x + 0.5 * slots * SLOT_S + beyond_m
        if abs(beyond_m - JUMP_M) > 1e-6:
            assert pose.jumps(slot, (x, 0.0, 0.0)) == (beyond_m > JUMP_M)
        else:
            pose.jumps(slot, (x, 0.0, 0.0))
