"""Links with rates, duplicates, flipped bits, reordering, bursts and soft edges."""

from dataclasses import replace
from math import inf, sqrt
from random import Random

import pytest

from netem.link import Cause, LinkState, Verdict, full_verdict, plain_verdict, reception_probability
from netem.link_model import LinkModel, path_loss_reach_m
from netem.link_parameters import Conditions, DirectedLink, GilbertElliott, PathLoss
from netem.medium import Medium
from netem.messages import MediumSetup
from netem.random_draws import MAX_QUANTILE, SHAPES, FrameDraws, PlainDraws, correlated_share
from netem.range_index import ARRAYS_FROM, KEPT_FROM, RangeIndex
from netem.rate_queue import RateQueue
from netem.wire.channels import LOCAL, MULTIHOP
from netem.wire.frame import Outgoing, Transmission

EDGE = PathLoss(3.0, 40.0, 70.0)
NOTHING_RARE = FrameDraws(
    loss=0.9,
    delay=0.5,
    path_loss=0.5,
    reorder=0.9,
    state_step=0.5,
    burst_loss=0.5,
    duplicate=0.9,
    corruption=0.9,
)


def radio(agents=3, **keys):
    made = Medium(MediumSetup(1, agents, 4, 80.0, Conditions(**keys)))
    made.place(((0.0, 0.0, 0.0),) * agents)
    return made


def say(made, sent_s, *payloads, source=0, channel=LOCAL):
    frames = tuple(Outgoing(channel, payload) for payload in payloads)
    made.transmit(source, sent_s, Transmission(0, 0, frames))


def test_frames_go_out_one_after_the_other_at_the_rate():
    """1000 bits at 10 kbit/s take 0.1 s each."""
    made = radio(rate_kbit=10.0, rate_overhead_b=25)
    say(made, 0.0, *[bytes(100)] * 3)
    assert [len(made.collect(1, now_s)) for now_s in (0.0999, 0.1001, 0.1999, 0.2001, 0.3001)] == [
        0,
        1,
        0,
        1,
        1,
    ]


def test_a_rate_is_the_senders_and_each_channel_has_its_own():
    made = radio(rate_kbit=10.0)
    say(made, 0.0, bytes(125))
    say(made, 0.0, bytes(125), source=1)
    say(made, 0.0, bytes(125), channel=MULTIHOP)
    assert len(made.collect(2, 0.1001)) == 3


def test_a_full_queue_drops_a_frame_for_all_receivers():
    made = radio(rate_kbit=10.0, limit=2)
    say(made, 0.0, *[bytes(125)] * 5)
    assert made.counters(0).fates["dropped_queue"] == 3 * 2
    assert len(made.collect(1, 1.0)) == 2
    say(made, 0.15, *[bytes(125)] * 5)
    assert made.counters(0).fates["dropped_queue"] == 3 * 2 + 4 * 2


def test_a_link_with_a_rate_of_its_own_has_a_queue_of_its_own():
    made = radio(link=(DirectedLink(source=0, to=1, rate_kbit=10.0, limit=1),))
    say(made, 0.0, bytes(125), bytes(125))
    assert len(made.collect(2, 0.0)) == 2
    assert [len(made.collect(1, now_s)) for now_s in (0.0999, 0.1001, 9.0)] == [0, 1, 0]
    assert made.counters(0).fates["dropped_queue"] == 1


def test_a_backlog_is_sent_at_the_new_rate():
    queue = RateQueue()
    for _ in range(10):
        queue.enter(0.0, 1000, rate_kbit=1.0, limit=100)  # 8 s each
    assert queue.enter(1.0, 1000, rate_kbit=800.0, limit=100) == pytest.approx(11 * 0.01)
    assert queue.enter(2.0, 1000, rate_kbit=800.0, limit=100) == pytest.approx(0.01)


def test_a_queue_recovers_from_a_tiny_rate():
    queue = RateQueue()
    assert queue.enter(0.0, 1000, rate_kbit=5e-324, limit=2) == inf
    assert queue.enter(1.0, 1000, rate_kbit=800.0, limit=2) == pytest.approx(0.02)


def test_an_idle_queue_starts_empty():
    queue = RateQueue()
    assert queue.enter(1.0, 125, 10.0, 9) == pytest.approx(0.1)
    assert queue.enter(1.05, 125, 10.0, 9) == pytest.approx(0.15)
    assert queue.enter(7.0, 125, 10.0, 9) == pytest.approx(0.1)


def test_a_duplicate_is_counted_and_delivered_like_the_first():
    made = radio(duplicate_percent=100.0, delay_ms=10.0)
    say(made, 0.0, b"a", b"b")
    assert [frame.payload for frame in made.collect(1, 1.0)] == [b"a", b"a", b"b", b"b"]
    counters = made.counters(0)
    assert (counters.sent, counters.addressed, counters.duplicated) == (2, 8, 4)


def test_a_corrupted_frame_is_delivered_with_one_bit_flipped():
    made = radio(corrupt_percent=100.0)
    whole = bytes(range(100))
    bits = set()
    for at in range(500):
        say(made, at * 1.0, whole)
        (frame,) = made.collect(1, at * 1.0)
        flipped = int.from_bytes(frame.payload, "big") ^ int.from_bytes(whole, "big")
        assert flipped.bit_count() == 1
        bits.add(flipped)
    assert len(bits) > 300
    say(made, 600.0, b"")
    assert made.collect(1, 600.0)[0].payload == b""
    assert made.counters(0).corrupted == 2 * 500


def test_a_reordered_frame_skips_the_delay():
    made = radio(delay_ms=100.0, reorder_percent=50.0)
    say(made, 0.0, *[bytes([at]) for at in range(100)])
    soon, late = made.collect(1, 0.0), made.collect(1, 0.1)
    assert 30 < len(soon) < 70
    assert len(soon) + len(late) == 100


def lost(model, steps):
    state, link = LinkState(), LinkModel(gemodel=model)
    draws = [replace(NOTHING_RARE, state_step=step) for step in steps]
    return [full_verdict(link, 0.0, each, state).cause is Cause.DROPPED_LOSS for each in draws]


def test_bursts_begin_and_end_by_their_own_steps():
    model = GilbertElliott(10.0, 50.0)
    assert lost(model, [0.5, 0.05, 0.9, 0.9, 0.4, 0.2]) == [False, False, True, True, True, False]


def test_a_good_link_may_lose_and_a_bad_one_may_not():
    model = GilbertElliott(10.0, 50.0, loss_bad_percent=40.0, loss_good_percent=60.0)
    assert lost(model, [0.05, 0.9, 0.4, 0.9]) == [True, False, False, True]


def test_a_soft_edge_is_half_at_the_budget_and_nothing_beyond_its_reach():
    assert reception_probability(EDGE, 10.0) == pytest.approx(0.5)
    assert reception_probability(EDGE, 0.0) == reception_probability(EDGE, 1.0) > 0.999999
    assert reception_probability(EDGE, path_loss_reach_m(EDGE)) == pytest.approx(1e-9, rel=0.02)
    assert LinkModel(path_loss=EDGE, range_m=8.0).reach_m == 8.0
    assert LinkModel(path_loss=EDGE, range_m=800.0).reach_m == path_loss_reach_m(EDGE)
    assert path_loss_reach_m(PathLoss(3.0, 40.0, 1.0)) == 0.0


def test_a_frame_lost_to_the_soft_edge_counts_as_out_of_range():
    link, draws = LinkModel(path_loss=EDGE), replace(NOTHING_RARE, path_loss=0.5001)
    assert full_verdict(link, 10.0, draws) == Verdict(Cause.DROPPED_RANGE)
    assert full_verdict(link, 9.9, draws).cause is Cause.DELIVERED


SHARES = [0.0, 0.01, 0.3, 0.5, 0.7, 0.99]


@pytest.mark.parametrize("loss", SHARES)
@pytest.mark.parametrize("delay", SHARES)
@pytest.mark.parametrize("distance_m", [1.0, 7.0])
def test_both_laws_agree_on_a_plain_link(loss, delay, distance_m):
    link = LinkModel(loss_percent=30.0, delay_ms=10.0, jitter_ms=15.0, range_m=6.0)
    plain, full = PlainDraws(loss, delay), replace(NOTHING_RARE, loss=loss, delay=delay)
    assert full_verdict(link, distance_m, full) == plain_verdict(link, distance_m, plain)


@pytest.mark.parametrize("shape", SHAPES)
def test_a_shape_is_monotonic_and_within_netems_tables(shape):
    values = [SHAPES[shape](at / 1000.0) for at in range(1000)]
    assert values == sorted(values)
    assert max(map(abs, values)) <= MAX_QUANTILE


def test_shapes_agree_with_netems_tables():
    """Some entries of iproute2's pareto.dist and paretonormal.dist, in 1/8192."""
    assert round(8192 * SHAPES["pareto"](0.0)) == -5461
    assert round(8192 * SHAPES["pareto"](1.0 - 1.0 / 8.0)) == 5461
    assert SHAPES["pareto"](0.99) == MAX_QUANTILE
    assert round(8192 * SHAPES["paretonormal"](0.875)) == round(0.75 * 5461 + 0.25 * 9423.6)


def test_correlated_shares_stay_shares():
    random, last, shares = Random(1), None, []
    for _ in range(20_000):
        share, last = correlated_share(random.random(), last, 0.9)
        shares.append(share)
    assert 0.0 <= min(shares) < 0.01
    assert 0.99 < max(shares) < 1.0
    assert correlated_share(0.999, 40.0, 0.9)[0] < 1.0
    mean = sum(shares) / len(shares)
    assert abs(mean - 0.5) < 3.29 * sqrt(1.0 / 12.0 * 19.0 / len(shares))


@pytest.mark.parametrize("seed", range(5))
def test_loop_and_arrays_find_the_same_receivers(seed):
    random, radios = Random(seed), ARRAYS_FROM + 20
    places = [tuple(random.uniform(-3.0, 3.0) for _ in range(3)) for _ in range(radios)]
    places[random.randrange(radios)] = None
    few, many = tuple(range(ARRAYS_FROM - 1)), tuple(range(radios))
    by_loop, by_array = RangeIndex(radios, few), RangeIndex(radios, many)
    for made in (by_loop, by_array):
        made.place(tuple(places))
    for source in range(radios):
        for reach_m in (2.0, float("inf")):
            near = by_array.in_range(source, reach_m)
            assert [each for each in near if each[0] in few] == by_loop.in_range(source, reach_m)


@pytest.mark.parametrize("arrays_from", [KEPT_FROM, 10 * KEPT_FROM])
@pytest.mark.parametrize("seed", range(3))
def test_receivers_that_move_are_found_as_if_they_were_looked_for_anew(
    seed, arrays_from, monkeypatch
):
    monkeypatch.setattr("netem.range_index.ARRAYS_FROM", arrays_from)
    random, radios = Random(seed), KEPT_FROM + 40
    receivers = tuple(range(0, radios, 2)) if seed else tuple(range(radios))
    kept = RangeIndex(radios, receivers)
    places = [[random.uniform(-4.0, 4.0) for _ in range(3)] for _ in range(radios)]
    speeds = [random.choice((0.0, 0.03, 0.2)) for _ in places]
    for _ in range(60):
        places = [
            [x + random.uniform(-speed, speed) for x in place]
            for place, speed in zip(places, speeds, strict=True)
        ]
        positions = [tuple(place) for place in places]
        for absent in random.sample(range(radios), random.choice((0, 3))):
            positions[absent] = None
        anew = RangeIndex(radios, receivers)
        for index in (kept, anew):
            index.place(tuple(positions))
        for source in random.sample(range(radios), 10):
            for reach_m in (1.5, 4.0):
                assert kept.in_range(source, reach_m) == anew.in_range(source, reach_m)
