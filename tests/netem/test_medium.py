"""The medium: nothing is lost from its books, nothing comes early, and every frame has one fate."""

from collections import Counter
from random import Random

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from netem.link_keys import Conditions, DirectedLink, LinkKeys
from netem.medium import Medium
from netem.messages import MediumSetup
from netem.wire.channels import LOCAL, MULTIHOP
from netem.wire.frame import (
    MAX_BATCH_B,
    MAX_FRAMES,
    Batch,
    Outgoing,
    Transmission,
    pack,
    unpack_batch,
)

AGENTS = 5
SLOT_S = 0.0125
TOGETHER = ((0.0, 0.0, 0.0),) * AGENTS
ROUGH = Conditions(range_m=4.0, delay_ms=40.0, jitter_ms=60.0, loss_percent=30.0)
BOUND = 0.0052
"""The 99.9 % interval of a share of 50 % among 100 000."""


def medium(conditions=ROUGH, seed=1, agents=AGENTS, positions=None):
    setup = MediumSetup(seed, agents, 4, 1.0 / SLOT_S, conditions)
    made = Medium(setup)
    made.place(TOGETHER[:1] * agents if positions is None else positions)
    return made


def said(*payloads, channel=LOCAL, incarnation=0, slot=0):
    frames = tuple(Outgoing(channel, payload) for payload in payloads)
    return Transmission(slot, incarnation, frames)


def books_balance(radio):
    medium_counters = radio.counters(0)
    assert (
        medium_counters.addressed == sum(medium_counters.fates.values()) + medium_counters.in_flight
    )
    assert min(*medium_counters.fates.values(), medium_counters.in_flight) >= 0


def test_bytes_are_counted_by_who_sent_them_and_on_which_channel():
    radio = medium()
    radio.transmit(1, 0.0, said(b"four", b"seven b"))
    radio.transmit(1, 0.5, said(b"far", channel=MULTIHOP, incarnation=1))
    radio.transmit(3, 0.5, said(b"near"))
    assert radio.counters(0).sent_b == (0, 0, 11, 3, 0, 0, 4, 0, 0, 0)


agents = st.integers(0, AGENTS - 1)
coordinate = st.floats(-3.0, 3.0)
operations = st.one_of(
    st.tuples(st.just("transmit"), agents, st.integers(0, 3), st.integers(0, 1)),
    st.tuples(
        st.just("place"),
        st.tuples(*[st.none() | st.tuples(coordinate, coordinate, coordinate)] * AGENTS),
    ),
    st.tuples(st.just("collect"), agents),
    st.tuples(st.just("discard"), agents),
    st.just(("wait",)),
)


@settings(derandomize=True, deadline=None, max_examples=200)
@given(st.lists(operations, max_size=60), st.integers(0, 9))
def test_every_frame_has_one_fate_or_is_in_flight(sequence, seed):
    radio, slot, came = medium(seed=seed), 0, 0
    for name, *values in sequence:
        if name == "transmit":
            source, count, channel = values
            radio.transmit(source, slot * SLOT_S, said(*[b"x"] * count, channel=channel))
        elif name == "place":
            radio.place(values[0])
        elif name == "collect":
            came += len(radio.collect(values[0], slot * SLOT_S))
        elif name == "discard":
            radio.discard(values[0])
        else:
            slot += 1
        books_balance(radio)
    for receiver in range(AGENTS):
        came += len(radio.collect(receiver, 1e9))
    books_balance(radio)
    assert radio.in_flight == 0
    assert radio.counters(0).fates["delivered"] == came


def test_the_departed_take_what_was_in_flight_to_them_along():
    radio = medium(Conditions(delay_ms=100.0))
    radio.transmit(0, 0.0, said(b"a", b"b"))
    radio.discard(1)
    fates = radio.counters(0).fates
    assert fates["dropped_medium"] == 2
    assert radio.in_flight == 2 * (AGENTS - 2)
    assert radio.collect(1, 1e9) == ()
    books_balance(radio)


@pytest.mark.parametrize("delay_ms", [0.0, 20.0, 130.0, 2000.0])
def test_a_frame_comes_when_its_delay_is_over_and_not_before(delay_ms):
    radio = medium(Conditions(delay_ms=delay_ms))
    sent_s = 7 * SLOT_S
    radio.transmit(0, sent_s, said(b"a"))
    due_s = sent_s + delay_ms / 1000.0
    assert radio.collect(1, due_s - 1e-9) == ()
    assert [frame.payload for frame in radio.collect(1, due_s)] == [b"a"]
    assert radio.collect(1, due_s + 1.0) == ()


def test_with_jitter_no_frame_comes_before_its_least_delay():
    radio, random = medium(Conditions(delay_ms=50.0, jitter_ms=30.0)), Random(4)
    for slot in range(400):
        now_s = slot * SLOT_S
        radio.transmit(random.randrange(1, AGENTS), now_s, said(repr(now_s).encode()))
        for frame in radio.collect(0, now_s):
            age_s = now_s - float(frame.payload)
            assert 0.020 - 1e-9 <= age_s <= 0.080 + SLOT_S + 1e-9


def sent(slots=40, seed=1, shuffle=None, silent=(), chatter=0, agents=AGENTS):
    """A conversation: what each receiver heard of (source, channel, count, payload), slot by slot.

    silent: agents that say nothing; chatter: how much more the last agent says.
    """
    positions = ((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (2.0, 0.0, 0.0), (3.9, 0.0, 0.0))
    positions += ((0.0, 1.0, 0.0),) * (agents - len(positions))
    radio, heard = medium(seed=seed, agents=agents, positions=positions), []
    for slot in range(slots):
        speakers = [who for who in range(agents) if who not in silent]
        if shuffle is not None:
            shuffle.shuffle(speakers)
        for who in speakers:
            words = [b"%d/%d" % (who, slot)] + [b"noise"] * (chatter if who == agents - 1 else 0)
            radio.transmit(who, slot * SLOT_S, said(*words, channel=slot % 2))
        heard.append([radio.collect(who, (slot + 1) * SLOT_S) for who in range(agents)])
    return heard, radio


def between(heard, sources, receivers):
    return [[[f for f in slot[who] if f.source in sources] for who in receivers] for slot in heard]


@pytest.mark.parametrize("shuffle_seed", range(5))
def test_the_order_of_transmissions_within_a_slot_does_not_show(shuffle_seed):
    assert sent()[0] == sent(shuffle=Random(shuffle_seed))[0]


def test_no_frame_comes_twice():
    heard, _ = sent(chatter=3)
    for who in range(AGENTS):
        came = Counter((f.source, f.channel, f.count) for slot in heard for f in slot[who])
        assert came
        assert set(came.values()) == {1}


def test_what_is_due_at_once_comes_in_canonical_order():
    radio = medium(Conditions(delay_ms=10.0))
    for source, incarnation, channel in ((3, 0, 0), (1, 1, 0), (1, 0, 1), (1, 0, 0), (2, 0, 1)):
        radio.transmit(source, 0.0, said(b"a", b"b", channel=channel, incarnation=incarnation))
    keys = [(f.source, f.incarnation, f.channel, f.count) for f in radio.collect(0, 1.0)]
    assert keys == sorted(keys)
    assert len(keys) == 10


def test_earlier_frames_come_first_whoever_sent_them():
    late = DirectedLink(source=1, to=0, delay_ms=30.0)
    radio = medium(Conditions(delay_ms=10.0, link=(late,)))
    radio.transmit(1, 0.0, said(b"first sent"))
    radio.transmit(2, 0.01, said(b"first due"))
    assert [f.payload for f in radio.collect(0, 1.0)] == [b"first due", b"first sent"]


def test_a_verdict_does_not_depend_on_what_others_send():
    quiet = between(sent(silent=(2, 4))[0], (0, 1), (0, 1, 3))
    loud = between(sent(chatter=20)[0], (0, 1), (0, 1, 3))
    assert quiet == loud


def test_a_verdict_does_not_depend_on_who_else_exists():
    few, many = sent(agents=5)[0], sent(agents=30)[0]
    everybody = range(5)
    assert between(few, everybody, everybody) == between(many, everybody, everybody)


def test_a_verdict_does_not_depend_on_the_other_channel():
    def lost(beacons):
        radio = medium()
        for slot in range(200):
            if beacons:
                radio.transmit(0, slot * SLOT_S, said(b"beacon", channel=LOCAL))
            radio.transmit(0, slot * SLOT_S, said(b"record", channel=MULTIHOP))
        return [f.count for f in radio.collect(1, 1e9) if f.channel == MULTIHOP]

    assert lost(beacons=True) == lost(beacons=False)


def test_a_restart_meets_new_numbers():
    def lost(incarnation):
        radio = medium()
        radio.transmit(0, 0.0, said(*[b"x"] * 64, incarnation=incarnation))
        return [f.count for f in radio.collect(1, 1e9)]

    assert lost(0) == lost(0) != lost(1)


def test_the_same_seed_gives_the_same_digest_and_another_another():
    digests = [sent(seed=seed)[1].digest() for seed in (1, 1, 2, 3)]
    assert digests[0] == digests[1]
    assert len(set(digests)) == 3


def test_the_digest_tells_one_changed_fate():
    near, far = medium(), medium(positions=(*TOGETHER[:4], (9.0, 0.0, 0.0)))
    for radio in (near, far):
        radio.transmit(0, 0.0, said(b"x"))
    assert near.digest() != far.digest()


def test_half_of_100_000_packets_get_through():
    radio = medium(Conditions(loss_percent=50.0), agents=2)
    came = 0
    for slot in range(100_000 // 50):
        radio.transmit(0, slot * SLOT_S, said(*[b"x"] * 50))
        came += len(radio.collect(1, slot * SLOT_S))
    assert abs(came / 100_000 - 0.5) < BOUND
    assert radio.counters(0).fates["dropped_loss"] == 100_000 - came


def test_two_receivers_of_the_same_frames_lose_others():
    radio = medium(Conditions(loss_percent=50.0), agents=3)
    agree = 0
    for slot in range(20_000):
        radio.transmit(0, slot * SLOT_S, said(b"x"))
        first, second = (radio.collect(who, slot * SLOT_S) for who in (1, 2))
        agree += len(first) == len(second)
    assert abs(agree / 20_000 - 0.5) < 3.29 * 0.5 / 20_000**0.5


def test_range_is_a_hard_disc_round_the_true_position():
    where = ((0.0, 0.0, 0.0), (2.0, 2.0, 1.0), (0.0, 0.0, 3.0 + 1e-9), None)
    radio = medium(Conditions(range_m=3.0), agents=4, positions=where)
    radio.transmit(0, 0.0, said(b"x"))
    assert [len(radio.collect(who, 1.0)) for who in range(4)] == [0, 1, 0, 0]
    assert radio.counters(0).fates["dropped_range"] == 2


def test_it_is_the_position_at_the_moment_of_sending_that_counts():
    near, far = TOGETHER, (*TOGETHER[:4], (50.0, 0.0, 0.0))
    radio = medium(Conditions(range_m=3.0, delay_ms=100.0), positions=near)
    radio.transmit(0, 0.0, said(b"while near"))
    radio.place(far)
    radio.transmit(0, 0.05, said(b"while far"))
    radio.place(near)
    assert [f.payload for f in radio.collect(4, 1.0)] == [b"while near"]


def test_who_is_not_in_the_world_neither_hears_nor_is_heard():
    radio = medium(Conditions(), agents=3, positions=((0.0, 0.0, 0.0), None, (0.0, 0.0, 0.0)))
    radio.transmit(0, 0.0, said(b"x"))
    radio.transmit(1, 0.0, said(b"y"))
    heard = [[f.payload for f in radio.collect(who, 1.0)] for who in range(3)]
    assert heard == [[], [], [b"x"]]
    assert radio.counters(0).fates["dropped_range"] == 3


def test_before_anybody_is_placed_nobody_hears():
    radio = Medium(MediumSetup(1, 3, 4, 80.0, Conditions()))
    radio.transmit(0, 0.0, said(b"x"))
    assert radio.in_flight == 0
    books_balance(radio)


def test_links_channels_and_both_have_their_own_conditions():
    dead = DirectedLink(source=0, to=1, loss_percent=100.0)
    slow = Conditions(delay_ms=10.0, multihop=LinkKeys(delay_ms=50.0), link=(dead,))
    radio = medium(slow, agents=3)
    for channel in (LOCAL, MULTIHOP):
        radio.transmit(0, 0.0, said(b"from 0", channel=channel))
        radio.transmit(1, 0.0, said(b"from 1", channel=channel))
    assert radio.collect(1, 1.0) == ()
    assert [f.source for f in radio.collect(0, 0.010)] == [1]
    assert [f.source for f in radio.collect(2, 0.049)] == [0, 1]
    assert [f.channel for f in radio.collect(2, 0.050)] == [MULTIHOP, MULTIHOP]


def test_it_says_when_each_frame_was_due():
    radio = medium(Conditions(delay_ms=7.0, rate_kbit=8.0, rate_overhead_b=0), agents=2)
    radio.transmit(0, 1.0, said(b"first", b"other"))
    due_s = [0.5]
    assert len(radio.collect(1, 2.0, due_s)) == 2
    assert due_s == pytest.approx([0.5, 1.0 + 0.007 + 0.005, 1.0 + 0.007 + 0.010])


@pytest.mark.parametrize(("size_b", "frames"), [(1200, 600), (0, 9000)])
def test_what_does_not_fit_one_batch_comes_with_the_next(size_b, frames):
    radio = medium(Conditions(), agents=2)
    for at in range(0, frames, 50):
        radio.transmit(0, at * 1e-6, said(*[b"x" * size_b] * 50, incarnation=2**53 - 1))
    heard = []
    while radio.in_flight:
        batch = Batch(2**53 - 1, radio.collect(1, 1.0))
        assert 0 < len(batch.frames) <= MAX_FRAMES
        assert unpack_batch(pack(batch)) == batch
        assert len(pack(batch)) <= MAX_BATCH_B
        heard += batch.frames
        books_balance(radio)
    assert [frame.count for frame in heard] == list(range(frames))
