"""A link as statistics: losses, delays, and which numbers are independent."""

import struct
from dataclasses import astuple, fields
from hashlib import blake2b
from itertools import pairwise
from math import inf, nan, sqrt

import pytest

from netem.link import Cause, Verdict, plain_verdict
from netem.link_model import LinkModel
from netem.random_draws import (
    GROUP_SIZE,
    FrameDraws,
    PlainDraws,
    Purpose,
    draw,
    draw_group,
    plain_draws,
)
from netem.wire.frame import Frame

PACKETS = 100_000
SEED = bytes(range(32))
KEY = {"source": 0, "incarnation": 0, "channel": 0, "count": 0}
FULL_KEY = {**KEY, "destination": 1, "purpose": Purpose.FRAME}
GROUP_KEY = {**KEY, "group": 0}


def frame_of(key):
    return Frame(key["source"], key["incarnation"], key["channel"], key["count"], b"")


def full(seed=SEED, **other):
    key = {**FULL_KEY, **other}
    return draw(seed, frame_of(key), key["destination"], key["purpose"])


def group(seed=SEED, **other):
    key = {**GROUP_KEY, **other}
    return draw_group(seed, frame_of(key), key["group"])


def draws(packets=PACKETS, **other):
    return [full(**other, count=count) for count in range(packets)]


def pairs(packets=PACKETS, destination=1):
    return [plain_draws(group(count=count), destination) for count in range(packets)]


def kolmogorov_smirnov(samples, distribution):
    """The Kolmogorov-Smirnov distance of samples from a distribution."""
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
    lost = sum(plain_verdict(link, 1.0, each).cause is Cause.DROPPED_LOSS for each in frames)
    share = loss_percent / 100.0
    bound = 3.29 * sqrt(share * (1.0 - share) / PACKETS)
    assert bound <= 0.0052 + 1e-5
    assert abs(lost / PACKETS - share) < bound


def test_no_loss_loses_nothing_and_full_loss_everything(frames):
    clean, dead = LinkModel(jitter_ms=1.0), LinkModel(loss_percent=100.0)
    assert all(plain_verdict(clean, 1.0, each).cause is Cause.DELIVERED for each in frames[:20_000])
    assert all(
        plain_verdict(dead, 1.0, each).cause is Cause.DROPPED_LOSS for each in frames[:20_000]
    )


def test_delay_is_uniform(frames):
    link = LinkModel(delay_ms=100.0, jitter_ms=40.0)
    delays = [plain_verdict(link, 1.0, each).delay_s for each in frames]
    assert kolmogorov_smirnov(delays, uniform(0.060, 0.140)) < 0.0062


def test_delay_of_what_survives_is_uniform_too(frames):
    link = LinkModel(delay_ms=100.0, jitter_ms=40.0, loss_percent=50.0)
    verdicts = [plain_verdict(link, 1.0, each) for each in frames]
    delays = [each.delay_s for each in verdicts if each.cause is Cause.DELIVERED]
    assert kolmogorov_smirnov(delays, uniform(0.060, 0.140)) < 1.95 / sqrt(len(delays))


def test_delay_is_never_negative(frames):
    link = LinkModel(delay_ms=10.0, jitter_ms=40.0)
    delays = [plain_verdict(link, 1.0, each).delay_s for each in frames]
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
    agree = sum(
        (a.loss < 0.5) == (b.loss < 0.5) for a, b in zip(frames, draws(**other), strict=True)
    )
    assert abs(agree / PACKETS - 0.5) < 0.0052


def test_successive_frames_are_lost_independently(frames):
    agree = sum((a.loss < 0.5) == (b.loss < 0.5) for a, b in pairwise(frames))
    assert abs(agree / (PACKETS - 1) - 0.5) < 0.0052


def test_a_draw_depends_on_every_part_of_its_key():
    assert full() == full()
    changes = {**dict.fromkeys(FULL_KEY, 9), "purpose": Purpose.COPY}
    others = [full(**{key: value}) for key, value in changes.items()]
    distinct = set(map(astuple, [full(), full(seed=bytes(32)), *others]))
    assert len(distinct) == 2 + len(FULL_KEY)
    assert all(0.0 <= number < 1.0 for each in draws(1000) for number in astuple(each))


def test_the_named_numbers_are_the_eight_words_of_the_hash():
    """Traces depend on which word of the hash each number is."""
    key = struct.pack("<6q", 3, 1, 7, 0, 42, 2)
    words = struct.unpack("<8Q", blake2b(key, key=SEED).digest())
    assert full(source=3, incarnation=1, destination=7, count=42, purpose=Purpose.COPY) == (
        FrameDraws(*[(word >> 11) / 2**53 for word in words])
    )
    assert tuple(field.name for field in fields(FrameDraws)) == (
        "loss",
        "delay",
        "path_loss",
        "reorder",
        "state_step",
        "burst_loss",
        "duplicate",
        "corruption",
    )


def test_a_group_draw_depends_on_every_part_of_its_key():
    assert group() == group()
    others = [group(**{key: 9}) for key in GROUP_KEY]
    assert len({group(), group(seed=bytes(32)), *others}) == 2 + len(GROUP_KEY)


def test_each_destination_of_a_group_has_numbers_of_its_own():
    drawn = group()
    numbers = [x for to in range(GROUP_SIZE) for x in astuple(plain_draws(drawn, to))]
    assert len(set(numbers)) == 2 * GROUP_SIZE
    assert all(0.0 <= number < 1.0 for number in numbers)
    assert plain_draws(drawn, GROUP_SIZE + 3) == plain_draws(drawn, 3)


@pytest.mark.parametrize("destination", [0, 1, GROUP_SIZE - 1])
def test_numbers_of_a_group_are_uniform_and_independent(destination):
    first, second = zip(*map(astuple, pairs(destination=destination)), strict=True)
    beside = [each.loss for each in pairs(destination=destination ^ 1)]
    for samples in (first, second):
        assert kolmogorov_smirnov(samples, uniform(0.0, 1.0)) < 1.95 / sqrt(PACKETS)
    for others in (second, beside):
        agree = sum((a < 0.5) == (b < 0.5) for a, b in zip(first, others, strict=True))
        assert abs(agree / PACKETS - 0.5) < 0.0052


@pytest.mark.parametrize("distance_m", [6.0 + 1e-9, inf, nan])
def test_beyond_the_range_nothing_gets_across(distance_m):
    link = LinkModel(range_m=6.0)
    assert plain_verdict(link, distance_m, None) == Verdict(Cause.DROPPED_RANGE)


@pytest.mark.parametrize("distance_m", [0.0, 1.0, 6.0])
def test_within_the_range_all_gets_across(distance_m):
    link = LinkModel(range_m=6.0, delay_ms=20.0)
    assert plain_verdict(link, distance_m, None) == Verdict(Cause.DELIVERED, 0.02)


def test_range_comes_before_loss():
    link = LinkModel(range_m=6.0, loss_percent=100.0)
    assert plain_verdict(link, 7.0, PlainDraws(0.0, 0.0)).cause is Cause.DROPPED_RANGE


def test_a_missing_position_hears_nothing_even_without_a_limit():
    assert plain_verdict(LinkModel(), nan, None).cause is Cause.DROPPED_RANGE


@pytest.mark.parametrize(
    ("link", "needs"),
    [
        (LinkModel(range_m=3.0, delay_ms=5.0), False),
        (LinkModel(jitter_ms=1.0), True),
        (LinkModel(loss_percent=1.0), True),
    ],
)
def test_a_model_knows_whether_it_needs_numbers(link, needs):
    assert link.draws is needs
