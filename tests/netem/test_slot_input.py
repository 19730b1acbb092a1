"""The world's message of a slot in lockstep: large enough for every team, and bounded."""

import pytest

from netem.messages import MAX_PARTICIPANTS, SlotInput, Truth, unpack_slot_input
from netem.wire.frame import MAX_OBSERVATION_B, WireError, pack


def encoded(participants: int, observation_b: int) -> bytes:
    slot_input = SlotInput(
        truth=Truth(slot=1, time_s=0.1, positions=((0.0, 0.0, 0.0),) * 4 * participants),
        participants=tuple(range(participants)),
        observations=(b"x" * observation_b,) * participants,
        incarnations=(0,) * 4 * participants,
    )
    return pack(slot_input)


def test_the_largest_team_fits_with_the_largest_observations() -> None:
    data = encoded(MAX_PARTICIPANTS, MAX_OBSERVATION_B)
    assert len(unpack_slot_input(data).observations) == MAX_PARTICIPANTS


def test_what_is_larger_is_refused() -> None:
    with pytest.raises(WireError, match="oversize"):
        unpack_slot_input(encoded(2 * MAX_PARTICIPANTS, MAX_OBSERVATION_B))
