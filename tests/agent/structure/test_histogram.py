"""Histograms of distances: sums saturate, and the share of the nearer ones is monotonic."""

from hypothesis import given, settings
from hypothesis import strategies as st

from agent.structure.histogram import BINS, EDGES_M, EMPTY, of_one, share_nearer, total

distances = st.floats(0.0, 1e4)
histograms = st.lists(distances, max_size=40).map(lambda all_m: total(map(of_one, all_m)))


@given(distances)
def test_one_member_is_in_one_bin(away_m):
    bins = of_one(away_m)
    assert len(bins) == BINS
    assert sum(bins) == 1
    k = bins.index(1)
    assert k == 0 or away_m > EDGES_M[k - 1]
    assert k == BINS - 1 or away_m <= EDGES_M[k]


@settings(derandomize=True)
@given(histograms, histograms, histograms)
def test_sums_are_commutative_and_associative(a, b, c):
    assert total([a, b]) == total([b, a])
    assert total([total([a, b]), c]) == total([a, total([b, c])]) == total([a, b, c])
    assert total([a, EMPTY]) == a


def test_a_bin_holds_at_most_255():
    full = total([of_one(0.1)] * 300)
    assert full == bytes([255]) + bytes(BINS - 1)
    assert total([full, full]) == full


@given(st.lists(st.binary(max_size=64), max_size=5), histograms)
def test_histograms_of_another_length_do_not_count(odd, known):
    odd = [each for each in odd if len(each) != BINS]
    assert total([*odd, known]) == known


@settings(derandomize=True)
@given(histograms, distances, distances)
def test_the_share_of_the_nearer_grows_with_the_distance(bins, one_m, other_m):
    near_m, far_m = sorted((one_m, other_m))
    assert 0.0 <= share_nearer(bins, near_m) <= share_nearer(bins, far_m) <= 1.0


def test_the_share_goes_from_none_to_all():
    bins = total(map(of_one, [1.0, 2.0, 3.0, 4.0]))
    assert share_nearer(bins, 0.0) == 0.0
    assert share_nearer(bins, 1e3) == 1.0
    assert 0.25 <= share_nearer(bins, 2.2) <= 0.75


@given(st.binary(max_size=64), distances)
def test_a_share_of_hostile_bytes_is_a_share(bins, away_m):
    assert 0.0 <= share_nearer(bins, away_m) <= 1.0
