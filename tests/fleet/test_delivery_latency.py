"""What the agents count together: quantiles of it, and what is not believed."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from netem.wire.frame import WireError, pack
from netem.wire.latency import BINS, BINS_PER_SLOT, LatencyReport
from worldsim.fleet.delivery_latency import ArrivalBook, quantile

SLOT_S = 0.0125
BIN_US = 1e6 * SLOT_S / BINS_PER_SLOT
PLENTY = 10**9
LATE_S = 100.0


def told(bins, multihop=None, incarnation=0, max_us=None):
    """Return what an agent tells that counted so many frames in each of these bins."""
    by_channel = (bins, multihop or {})
    rows = tuple(tuple(row.get(at, 0) for at in range(BINS)) for row in by_channel)
    max_us = max_us or tuple(int(max(row, default=0) * BIN_US) for row in by_channel)
    return pack(LatencyReport(incarnation, rows, max_us))


@pytest.fixture
def book():
    return ArrivalBook(4, SLOT_S)


counts = st.lists(st.integers(0, 50), min_size=1, max_size=30).filter(any)


@settings(derandomize=True, deadline=None, max_examples=300)
@given(counts, st.floats(0.01, 100.0))
def test_a_quantile_is_the_least_bin_that_has_so_many_at_or_below_it(bins, percent):
    at, wanted = quantile(bins, percent), percent / 100.0 * sum(bins)
    assert bins[at] > 0
    assert sum(bins[: at + 1]) >= wanted
    assert at == 0 or sum(bins[:at]) < wanted or not any(bins[:at])


@settings(derandomize=True, deadline=None, max_examples=100)
@given(st.lists(st.dictionaries(st.integers(0, BINS - 1), st.integers(1, 99)), max_size=4))
def test_the_sum_over_agents_keeps_every_frame_and_its_order(agents):
    book = ArrivalBook(4, SLOT_S)
    for agent, bins in enumerate(agents):
        book.take(agent, 0, told(bins), LATE_S)
    summary = book.summary(PLENTY)
    frames = sum(sum(bins.values()) for bins in agents)
    if not frames:
        assert summary is None
        return
    assert summary["frames"] == summary["channels"]["local"]["frames"] == frames
    assert summary["channels"]["multihop"] is None
    within = sum(n for bins in agents for at, n in bins.items() if at <= 5 * BINS_PER_SLOT)
    assert summary["within_fraction"] == within / frames
    spread = list(summary["excess_ms"].values())
    assert spread == sorted(spread)
    assert spread[-1] == int(max(at for bins in agents for at in bins) * BIN_US) / 1000.0


def test_the_bound_is_one_slot_and_one_tick(book):
    book.take(0, 0, told({16: 1, 40: 2, 41: 1}, {24: 4}, max_us=(63_000, 37_500)), LATE_S)
    summary = book.summary(PLENTY)
    assert summary["bound_ms"] == 62.5
    assert summary["within_fraction"] == 7 / 8
    assert summary["channels"]["local"]["within_fraction"] == 3 / 4
    assert summary["channels"]["multihop"]["excess_ms"]["p50"] == 37.5
    assert summary["channels"]["local"]["excess_ms"]["max"] == 63.0


def test_the_last_word_of_each_process_counts(book):
    book.take(0, 0, told({8: 5}), LATE_S)
    book.take(0, 0, told({8: 7}), LATE_S)
    book.take(0, 1, told({16: 2}, incarnation=1), LATE_S)
    assert book.summary(PLENTY)["frames"] == 9


def test_nothing_told_is_nothing_measured(book):
    assert book.summary(PLENTY) is None
    book.take(0, 0, told({}, max_us=(0, 0)), LATE_S)
    assert book.summary(PLENTY) is None


def test_who_counts_backwards_or_speaks_for_another_process_is_not_believed(book):
    book.take(0, 0, told({8: 5}), LATE_S)
    lies = [
        told({8: 4, 9: 3}),
        told({8: 6}, max_us=(10_938, 0)),
        told({8: 6}, max_us=(200_000_000, 0)),
        told({8: 6, BINS - 1: 1}, max_us=(200_000_000, 0)),
        told({8: 6}, max_us=(12_500, 2_000)),
        told({8: 6}, incarnation=1),
        b"junk",
    ]
    for lie in lies:
        with pytest.raises(WireError):
            book.take(0, 0, lie, LATE_S)
    assert book.summary(PLENTY)["frames"] == 5


def test_who_counts_more_than_the_radio_delivered_is_left_out(book):
    book.take(0, 0, told({8: 5}), LATE_S)
    book.take(1, 0, told({0: 2**50}), LATE_S)
    assert book.summary(100)["frames"] == 5
    assert book.summary(4) is None
