"""Many senders on one topic: each is read, and a flooder no more than what is bounded."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from netem.wire.bus import Rings


class Said:
    """A ring that holds so many messages."""

    def __init__(self, waiting):
        self.waiting = waiting

    def drain(self, quota):
        taken = min(quota, self.waiting)
        self.waiting -= taken
        return [b""] * taken


@settings(derandomize=True, deadline=None)
@given(st.lists(st.integers(0, Rings.SIZE), min_size=1, max_size=40))
def test_everybody_is_read_up_to_the_quota_and_all_up_to_a_bound(waiting):
    read = [len(found) for _, found in Rings([Said(each) for each in waiting]).drain()]
    assert all(got >= min(each, Rings.QUOTA) for got, each in zip(read, waiting, strict=True))
    assert sum(read) <= Rings.RESERVE + Rings.QUOTA * len(waiting)
    over = sum(max(0, each - Rings.QUOTA) for each in waiting)
    if over <= Rings.RESERVE:
        assert read == waiting


@pytest.mark.parametrize("flooder", [0, 5, 9])
def test_one_flooder_is_read_to_the_end_and_costs_nobody_anything(flooder):
    rings = [Said(Rings.SIZE if at == flooder else 1) for at in range(10)]
    read = {sender: len(found) for sender, found in Rings(rings).drain()}
    assert read == {at: Rings.SIZE if at == flooder else 1 for at in range(10)}
