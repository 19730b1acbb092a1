"""Delivery latency: every frame is counted once, in the bin of its excess."""

from math import ceil

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from netem.wire.channels import CHANNELS
from netem.wire.frame import Frame, WireError, pack
from netem.wire.latency import (
    BINNED_SLOTS,
    BINS,
    BINS_PER_SLOT,
    MAX_REPORT_B,
    LatencyHistogram,
    LatencyReport,
    unpack_report,
)

SLOT_S = 0.0125
BIN_US = 1e6 * SLOT_S / BINS_PER_SLOT
NONE = ((0,) * BINS,) * 2


def frame(channel=0):
    return Frame(1, 0, channel, 5, b"payload")


def counted(excess_us, slots=0, channel=0):
    histogram = LatencyHistogram(SLOT_S)
    histogram.add((frame(channel),), (excess_us,), slots)
    report = histogram.report(0)
    assert sum(report.counts[1 - channel]) == 0
    return report.counts[channel].index(1), report.max_us[channel]


uses = st.tuples(st.integers(0, 1), st.integers(0, 600_000), st.integers(0, 40))


@settings(derandomize=True, deadline=None, max_examples=300)
@given(st.lists(uses, max_size=40))
def test_every_frame_is_counted_once_on_its_channel(used):
    histogram = LatencyHistogram(SLOT_S)
    for channel, early_us, slots in used:
        histogram.add((frame(channel),), (early_us,), slots)
    report = histogram.report(3)
    assert report.incarnation == 3
    for channel in range(len(CHANNELS)):
        excesses = [early + round(slots * 1e6 * SLOT_S) for c, early, slots in used if c == channel]
        assert sum(report.counts[channel]) == len(excesses)
        assert report.max_us[channel] == max(excesses, default=0)
        for at, count in enumerate(report.counts[channel][:-1]):
            below = sum(excess <= at * BIN_US + 1 for excess in excesses)
            assert sum(report.counts[channel][: at + 1]) == below or count == 0


@settings(derandomize=True, deadline=None, max_examples=300)
@given(st.integers(0, 10_000_000))
def test_an_excess_is_at_most_its_bins_edge_and_above_the_edge_before(excess_us):
    at, max_us = counted(excess_us)
    assert max_us == excess_us
    if at == BINS - 1:
        assert excess_us > BINNED_SLOTS * 1e6 * SLOT_S
    else:
        assert (at - 1) * BIN_US < excess_us <= at * BIN_US + 1.5 or at == ceil(excess_us / BIN_US)


@pytest.mark.parametrize("slots", range(BINNED_SLOTS + 1))
@pytest.mark.parametrize("rounding_us", [-1, 0, 1])
def test_whole_slots_are_edges_whatever_the_rounding(slots, rounding_us):
    excess_us = max(0, round(slots * 1e6 * SLOT_S) + rounding_us)
    assert counted(excess_us)[0] == slots * BINS_PER_SLOT
    assert counted(0, slots)[0] == slots * BINS_PER_SLOT


def test_slots_are_edges_at_a_rate_without_whole_microseconds():
    histogram = LatencyHistogram(1.0 / 120.0)
    histogram.add((frame(),), (round(3e6 / 120.0),), 2)
    assert histogram.report(0).counts[0].index(1) == 5 * BINS_PER_SLOT


def test_the_greatest_report_survives_the_wire():
    greatest = LatencyReport(2**53 - 1, ((2**53 - 1,) * BINS,) * 2, (2**53 - 1,) * 2)
    assert unpack_report(pack(greatest)) == greatest
    assert len(pack(greatest)) <= MAX_REPORT_B


@pytest.mark.parametrize(
    "bad",
    [
        b"",
        b"junk",
        b"x" * (MAX_REPORT_B + 1),
        pack(LatencyReport(0, NONE[:1], (0, 0))),
        pack(LatencyReport(0, (NONE[0][:-1], NONE[1]), (0, 0))),
        pack(LatencyReport(0, NONE, (0, 0, 0))),
        pack(LatencyReport(-1, NONE, (0, 0))),
        pack(LatencyReport(0, ((-1, *NONE[0][1:]), NONE[1]), (0, 0))),
        pack(LatencyReport(0, NONE, (2**53, 0))),
    ],
)
def test_a_malformed_report_is_refused(bad):
    with pytest.raises(WireError):
        unpack_report(bad)
