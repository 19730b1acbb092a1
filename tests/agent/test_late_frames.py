"""Late frames: what a slow step says leaves with the next step, and nothing is lost or doubled."""

from hypothesis import given, settings
from hypothesis import strategies as st

from agent.late_frames import LateFrames


@settings(derandomize=True, deadline=None)
@given(st.lists(st.booleans(), min_size=1, max_size=30))
def test_each_step_is_sent_once_and_a_slow_one_with_the_next(slow_steps):
    late, sent = LateFrames(), []
    for step, slow in enumerate(slow_steps):
        frames = late.sent(((0, str(step).encode()),), slow)
        sent += [(int(payload), step) for _, payload in frames]
    expected = [
        (step, step + slow) for step, slow in enumerate(slow_steps) if step + slow < len(slow_steps)
    ]
    assert sent == expected
