"""A link as statistics: what is lost, when the rest arrives, and what depends on what."""

from itertools import pairwise
from math import inf, nan, sqrt

import pytest

from netem.link import Cause, LinkModel, Verdict, verdict
from netem.random_draws import SHARING, draw, draw_shared, pair

PACKETS = 100_000
SEED = bytes(range(32))
SHARED = {"seed": SEED, "source": 0, "incarnation": 0, "group": 0, "channel": 0, "count": 0}
KEY = {**SHARED, "destination": 1, "purpose": 1}
KEY.pop("group")


def draws(packets=PACKETS, **other):
    key = {**KEY, **other}
    return [draw(**{**key, "count": count}) for count in range(packets)]


def pairs(packets=PACKETS, destination=1, **other):
    key = {**SHARED, **other}
    return [pair(draw_shared(**{**key, "count": k}), destination) for k in range(packets)]


def kolmogorov_smirnov(samples, distribution):
    """The largest distance between the samples' distribution and the one that they should have."""
    count = len(samples)
    return max(
        max((k + 1) / count - distribution(x), distribution(x) - k / count)
        for k, x in enumerate(sorted(samples))
    )


def uniform(low, high):
    return lambda x: min(1.0, max(0.0, (x - low) / (high - low)))


@pytest.fixture(scope="module")
def frames():
    return pairs()


@pytest.mark.parametrize("loss_percent", [1.0, 10.0, 50.0, 80.0, 99.0])
def test_loss_is_what_the_link_says(frames, loss_percent):
    link = LinkModel(loss_percent=loss_percent)
    lost = sum(verdict(link, 1.0, each).cause is Cause.DROPPED_LOSS for each in frames)
    share = loss_percent / 100.0
    bound = 3.29 * sqrt(share * (1.0 - share) / PACKETS)
    assert bound <= 0.0052 + 1e-5
    assert abs(lost / PACKETS - share) < bound


def test_no_loss_loses_nothing_and_full_loss_everything(frames):
    clean, dead = LinkModel(jitter_ms=1.0), LinkModel(loss_percent=100.0)
    assert all(verdict(clean, 1.0, each).cause is Cause.DELIVERED for each in frames[:20_000])
    assert all(verdict(dead, 1.0, each).cause is Cause.DROPPED_LOSS for each in frames[:20_000])


def test_delay_is_uniform(frames):
    link = LinkModel(delay_ms=100.0, jitter_ms=40.0)
    delays = [verdict(link, 1.0, each).delay_s for each in frames]
    assert kolmogorov_smirnov(delays, uniform(0.060, 0.140)) < 0.0062


def test_delay_of_what_survives_is_uniform_too(frames):
    link = LinkModel(delay_ms=100.0, jitter_ms=40.0, loss_percent=50.0)
    medium_counters = [verdict(link, 1.0, each) for each in frames]
    delays = [each.delay_s for each in medium_counters if each.cause is Cause.DELIVERED]
    assert kolmogorov_smirnov(delays, uniform(0.060, 0.140)) < 1.95 / sqrt(len(delays))


def test_delay_is_never_negative(frames):
    link = LinkModel(delay_ms=10.0, jitter_ms=40.0)
    delays = [verdict(link, 1.0, each).delay_s for each in frames]
    assert min(delays) == 0.0
    at_once = sum(delay == 0.0 for delay in delays) / PACKETS
    assert abs(at_once - 30.0 / 80.0) < 0.0052


@pytest.mark.parametrize(
    "other",
    [
        {"destination": 2},
        {"source": 1, "destination": 0},
        {"source": 7},
        {"channel": 1},
        {"incarnation": 1},
        {"seed": bytes(32)},
    ],
    ids="-".join,
)
def test_two_links_lose_independently(frames, other):
    agree = sum((a[0] < 0.5) == (b[0] < 0.5) for a, b in zip(frames, draws(**other), strict=True))
    assert abs(agree / PACKETS - 0.5) < 0.0052


def test_one_frame_says_nothing_about_the_next(frames):
    agree = sum((a[0] < 0.5) == (b[0] < 0.5) for a, b in pairwise(frames))
    assert abs(agree / (PACKETS - 1) - 0.5) < 0.0052


def test_a_draw_belongs_to_its_frame_alone():
    assert draw(**KEY) == draw(**KEY)
    assert len({each for key in KEY if key != "seed" for each in [draw(**{**KEY, key: 9})]}) == 6
    assert all(0.0 <= number < 1.0 for each in draws(1000) for number in each)


def test_a_shared_draw_belongs_to_its_frame_and_group_alone():
    assert draw_shared(**SHARED) == draw_shared(**SHARED)
    others = [draw_shared(**{**SHARED, key: 9}) for key in SHARED if key != "seed"]
    assert len({draw_shared(**SHARED), *others}) == 6


def test_of_a_shared_draw_each_destination_has_two_numbers_of_its_own():
    shared = draw_shared(**SHARED)
    numbers = [number for destination in range(SHARING) for number in pair(shared, destination)]
    assert len(set(numbers)) == 2 * SHARING
    assert all(0.0 <= number < 1.0 for number in numbers)
    assert pair(shared, SHARING + 3) == pair(shared, 3)


@pytest.mark.parametrize("destination", [0, 1, SHARING - 1])
def test_numbers_of_shared_draws_are_uniform_and_independent(destination):
    first, second = zip(*pairs(destination=destination), strict=True)
    beside, _ = zip(*pairs(destination=destination ^ 1), strict=True)
    for samples in (first, second):
        assert kolmogorov_smirnov(samples, uniform(0.0, 1.0)) < 1.95 / sqrt(PACKETS)
    for others in (second, beside):
        agree = sum((a < 0.5) == (b < 0.5) for a, b in zip(first, others, strict=True))
        assert abs(agree / PACKETS - 0.5) < 0.0052


@pytest.mark.parametrize("distance_m", [6.0 + 1e-9, inf, nan])
def test_beyond_the_range_nothing_gets_across(distance_m):
    link = LinkModel(range_m=6.0)
    assert verdict(link, distance_m, None) == Verdict(Cause.DROPPED_RANGE)


@pytest.mark.parametrize("distance_m", [0.0, 1.0, 6.0])
def test_within_the_range_all_gets_across(distance_m):
    link = LinkModel(range_m=6.0, delay_ms=20.0)
    assert verdict(link, distance_m, None) == Verdict(Cause.DELIVERED, 0.02)


def test_range_comes_before_loss():
    link = LinkModel(range_m=6.0, loss_percent=100.0)
    assert verdict(link, 7.0, (0.0, 0.0)).cause is Cause.DROPPED_RANGE


def test_where_there_is_no_limit_a_missing_position_hears_nothing():
    assert verdict(LinkModel(), nan, None).cause is Cause.DROPPED_RANGE


@pytest.mark.parametrize(
    ("link", "needs"),
    [
        (LinkModel(range_m=3.0, delay_ms=5.0), False),
        (LinkModel(jitter_ms=1.0), True),
        (LinkModel(loss_percent=1.0), True),
    ],
)
def test_a_link_says_whether_it_needs_numbers(link, needs):
    assert link.draws is needs
