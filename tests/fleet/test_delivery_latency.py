"""The distribution of the agents' counts of late frames, and which counts are rejected."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from netem.wire.frame import WireError, pack
from netem.wire.latency import BINS, BINS_PER_SLOT, LatencyReport
from worldsim.fleet.delivery_latency import LatencyCollector, quantile

SLOT_S = 0.0125
BIN_US = 1e6 * SLOT_S / BINS_PER_SLOT
MANY = 10**9
LATE_S = 100.0


def encoded(bins, multihop=None, incarnation=0, max_us=None):
    """Return an agent's encoded counts: a number of frames for each bin of each channel."""
    by_channel = (bins, multihop or {})
    rows = tuple(tuple(row.get(at, 0) for at in range(BINS)) for row in by_channel)
    max_us = max_us or tuple(int(max(row, default=0) * BIN_US) for row in by_channel)
    return pack(LatencyReport(incarnation, rows, max_us))


@pytest.fixture
def collector():
    return LatencyCollector(4, SLOT_S)


counts = st.lists(st.integers(0, 50), min_size=1, max_size=30).filter(any)


@settings(derandomize=True, deadline=None, max_examples=300)
@given(counts, st.floats(0.01, 100.0))
def test_a_quantile_is_the_first_bin_with_the_percentage_at_or_below_it(bins, percent):
    at, wanted = quantile(bins, percent), percent / 100.0 * sum(bins)
    assert bins[at] > 0
    assert sum(bins[: at + 1]) >= wanted
    assert at == 0 or sum(bins[:at]) < wanted or not any(bins[:at])


@settings(derandomize=True, deadline=None, max_examples=100)
@given(st.lists(st.dictionaries(st.integers(0, BINS - 1), st.integers(1, 99)), max_size=4))
def test_the_distribution_counts_every_frame_and_is_ordered(agents):
    collector = LatencyCollector(4, SLOT_S)
    for agent, bins in enumerate(agents):
        collector.add(agent, 0, encoded(bins), LATE_S)
    summary = collector.summary(MANY)
    frames = sum(sum(bins.values()) for bins in agents)
    if not frames:
        assert summary is None
        return
    assert summary.frames == summary.channels["local"].frames == frames
    assert summary.channels["multihop"] is None
    within = sum(n for bins in agents for at, n in bins.items() if at <= 5 * BINS_PER_SLOT)
    assert summary.within_fraction == within / frames
    spread = list(summary.excess_ms.values())
    assert spread == sorted(spread)
    assert spread[-1] == int(max(at for bins in agents for at in bins) * BIN_US) / 1000.0


def test_the_bound_is_one_slot_and_one_tick(collector):
    collector.add(0, 0, encoded({16: 1, 40: 2, 41: 1}, {24: 4}, max_us=(63_000, 37_500)), LATE_S)
    summary = collector.summary(MANY)
    assert summary.bound_ms == 62.5
    assert summary.within_fraction == 7 / 8
    assert summary.channels["local"].within_fraction == 3 / 4
    assert summary.channels["multihop"].excess_ms["p50"] == 37.5
    assert summary.channels["local"].excess_ms["max"] == 63.0


def test_the_last_counts_of_each_process_are_used(collector):
    collector.add(0, 0, encoded({8: 5}), LATE_S)
    collector.add(0, 0, encoded({8: 7}), LATE_S)
    collector.add(0, 1, encoded({16: 2}, incarnation=1), LATE_S)
    assert collector.summary(MANY).frames == 9


def test_without_a_frame_there_is_no_distribution(collector):
    assert collector.summary(MANY) is None
    collector.add(0, 0, encoded({}, max_us=(0, 0)), LATE_S)
    assert collector.summary(MANY) is None


def test_decreasing_implausible_or_foreign_counts_are_rejected(collector):
    collector.add(0, 0, encoded({8: 5}), LATE_S)
    rejected = [
        encoded({8: 4, 9: 3}),
        encoded({8: 6}, max_us=(10_938, 0)),
        encoded({8: 6}, max_us=(200_000_000, 0)),
        encoded({8: 6, BINS - 1: 1}, max_us=(200_000_000, 0)),
        encoded({8: 6}, max_us=(12_500, 2_000)),
        encoded({8: 6}, incarnation=1),
        b"junk",
    ]
    for data in rejected:
        with pytest.raises(WireError):
            collector.add(0, 0, data, LATE_S)
    assert collector.summary(MANY).frames == 5


def test_counts_of_more_frames_than_the_radio_delivered_are_left_out(collector):
    collector.add(0, 0, encoded({8: 5}), LATE_S)
    collector.add(1, 0, encoded({0: 2**50}), LATE_S)
    assert collector.summary(100).frames == 5
    assert collector.summary(4) is None
