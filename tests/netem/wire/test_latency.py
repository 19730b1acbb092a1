"""How late frames came: every frame is counted once, in the bin that its excess belongs to."""

from math import ceil

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from netem.wire.channels import CHANNELS
from netem.wire.frame import Frame, WireError, pack
from netem.wire.latency import (
    BINS,
    BINS_A_SLOT,
    MAX_ARRIVALS_B,
    SLOTS_SEEN,
    Arrivals,
    Tally,
    unpack_arrivals,
)

SLOT_S = 0.0125
BIN_US = 1e6 * SLOT_S / BINS_A_SLOT
NONE = ((0,) * BINS,) * 2


def frame(channel=0):
    return Frame(1, 0, channel, 5, b"payload")


def counted(excess_us, slots=0, channel=0):
    tally = Tally(SLOT_S)
    tally.note((frame(channel),), (excess_us,), slots)
    told = tally.told(0)
    assert sum(told.counts[1 - channel]) == 0
    return told.counts[channel].index(1), told.most_us[channel]


uses = st.tuples(st.integers(0, 1), st.integers(0, 600_000), st.integers(0, 40))


@settings(derandomize=True, deadline=None, max_examples=300)
@given(st.lists(uses, max_size=40))
def test_every_frame_is_counted_once_on_its_channel(used):
    tally = Tally(SLOT_S)
    for channel, early_us, slots in used:
        tally.note((frame(channel),), (early_us,), slots)
    told = tally.told(3)
    assert told.incarnation == 3
    for channel in range(len(CHANNELS)):
        excesses = [early + round(slots * 1e6 * SLOT_S) for c, early, slots in used if c == channel]
        assert sum(told.counts[channel]) == len(excesses)
        assert told.most_us[channel] == max(excesses, default=0)
        for at, count in enumerate(told.counts[channel][:-1]):
            below = sum(excess <= at * BIN_US + 1 for excess in excesses)
            assert sum(told.counts[channel][: at + 1]) == below or count == 0


@settings(derandomize=True, deadline=None, max_examples=300)
@given(st.integers(0, 10_000_000))
def test_an_excess_is_at_most_its_bins_edge_and_above_the_edge_before(excess_us):
    at, most_us = counted(excess_us)
    assert most_us == excess_us
    if at == BINS - 1:
        assert excess_us > SLOTS_SEEN * 1e6 * SLOT_S
    else:
        assert (at - 1) * BIN_US < excess_us <= at * BIN_US + 1.5 or at == ceil(excess_us / BIN_US)


@pytest.mark.parametrize("slots", range(SLOTS_SEEN + 1))
@pytest.mark.parametrize("rounding_us", [-1, 0, 1])
def test_whole_slots_are_edges_whatever_the_rounding(slots, rounding_us):
    excess_us = max(0, round(slots * 1e6 * SLOT_S) + rounding_us)
    assert counted(excess_us)[0] == slots * BINS_A_SLOT
    assert counted(0, slots)[0] == slots * BINS_A_SLOT


def test_a_rate_that_has_no_whole_microseconds_has_its_edges_too():
    tally = Tally(1.0 / 120.0)
    tally.note((frame(),), (round(3e6 / 120.0),), 2)
    assert tally.told(0).counts[0].index(1) == 5 * BINS_A_SLOT


def test_what_an_agent_counted_survives_the_wire_at_its_greatest():
    greatest = Arrivals(2**53 - 1, ((2**53 - 1,) * BINS,) * 2, (2**53 - 1,) * 2)
    assert unpack_arrivals(pack(greatest)) == greatest
    assert len(pack(greatest)) <= MAX_ARRIVALS_B


@pytest.mark.parametrize(
    "bad",
    [
        b"",
        b"junk",
        b"x" * (MAX_ARRIVALS_B + 1),
        pack(Arrivals(0, NONE[:1], (0, 0))),
        pack(Arrivals(0, (NONE[0][:-1], NONE[1]), (0, 0))),
        pack(Arrivals(0, NONE, (0, 0, 0))),
        pack(Arrivals(-1, NONE, (0, 0))),
        pack(Arrivals(0, ((-1, *NONE[0][1:]), NONE[1]), (0, 0))),
        pack(Arrivals(0, NONE, (2**53, 0))),
    ],
)
def test_what_is_no_count_is_refused(bad):
    with pytest.raises(WireError):
        unpack_arrivals(bad)
