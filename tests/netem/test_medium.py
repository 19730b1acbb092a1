"""The medium: conservation of frames, due times, canonical order, independent verdicts."""

from collections import Counter
from random import Random

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from netem.link_parameters import Conditions, DirectedLink, LinkKeys
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
ONE_POINT = ((0.0, 0.0, 0.0),) * AGENTS
ROUGH = Conditions(range_m=4.0, delay_ms=40.0, jitter_ms=60.0, loss_percent=30.0)
BOUND = 0.0052
"""The 99.9 % interval of a share of 50 % among 100 000."""


def medium(conditions=ROUGH, seed=1, agents=AGENTS, positions=None):
    setup = MediumSetup(seed, agents, 4, 1.0 / SLOT_S, conditions)
    made = Medium(setup)
    made.place(ONE_POINT[:1] * agents if positions is None else positions)
    return made


def transmission(*payloads, channel=LOCAL, incarnation=0, slot=0):
    frames = tuple(Outgoing(channel, payload) for payload in payloads)
    return Transmission(slot, incarnation, frames)


def check_conservation(radio):
    counters = radio.counters(0)
    assert counters.addressed == sum(counters.fates.values()) + counters.in_flight
    assert min(*counters.fates.values(), counters.in_flight) >= 0


def test_bytes_are_counted_by_sender_and_channel():
    radio = medium()
    radio.transmit(1, 0.0, transmission(b"four", b"seven b"))
    radio.transmit(1, 0.5, transmission(b"far", channel=MULTIHOP, incarnation=1))
    radio.transmit(3, 0.5, transmission(b"near"))
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
    radio, slot, received_count = medium(seed=seed), 0, 0
    for name, *values in sequence:
        if name == "transmit":
            source, count, channel = values
            radio.transmit(source, slot * SLOT_S, transmission(*[b"x"] * count, channel=channel))
        elif name == "place":
            radio.place(values[0])
        elif name == "collect":
            received_count += len(radio.collect(values[0], slot * SLOT_S))
        elif name == "discard":
            radio.discard(values[0])
        else:
            slot += 1
        check_conservation(radio)
    for receiver in range(AGENTS):
        received_count += len(radio.collect(receiver, 1e9))
    check_conservation(radio)
    assert radio.in_flight == 0
    assert radio.counters(0).fates["delivered"] == received_count


def test_frames_in_flight_to_a_discarded_receiver_are_dropped_by_the_medium():
    radio = medium(Conditions(delay_ms=100.0))
    radio.transmit(0, 0.0, transmission(b"a", b"b"))
    radio.discard(1)
    fates = radio.counters(0).fates
    assert fates["dropped_medium"] == 2
    assert radio.in_flight == 2 * (AGENTS - 2)
    assert radio.collect(1, 1e9) == ()
    check_conservation(radio)


@pytest.mark.parametrize("delay_ms", [0.0, 20.0, 130.0, 2000.0])
def test_a_frame_arrives_exactly_after_its_delay(delay_ms):
    radio = medium(Conditions(delay_ms=delay_ms))
    sent_s = 7 * SLOT_S
    radio.transmit(0, sent_s, transmission(b"a"))
    due_s = sent_s + delay_ms / 1000.0
    assert radio.collect(1, due_s - 1e-9) == ()
    assert [frame.payload for frame in radio.collect(1, due_s)] == [b"a"]
    assert radio.collect(1, due_s + 1.0) == ()


def test_with_jitter_every_delay_is_within_its_bounds():
    radio, random = medium(Conditions(delay_ms=50.0, jitter_ms=30.0)), Random(4)
    for slot in range(400):
        now_s = slot * SLOT_S
        radio.transmit(random.randrange(1, AGENTS), now_s, transmission(repr(now_s).encode()))
        for frame in radio.collect(0, now_s):
            age_s = now_s - float(frame.payload)
            assert 0.020 - 1e-9 <= age_s <= 0.080 + SLOT_S + 1e-9


def sent(slots=40, seed=1, shuffle=None, silent=(), chatter=0, agents=AGENTS):
    """Play slots with random traffic; return the frames of each receiver by slot, and the medium.

    silent: agents that send nothing; chatter: extra frames that the last agent sends in a slot.
    """
    positions = ((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (2.0, 0.0, 0.0), (3.9, 0.0, 0.0))
    positions += ((0.0, 1.0, 0.0),) * (agents - len(positions))
    radio, received = medium(seed=seed, agents=agents, positions=positions), []
    for slot in range(slots):
        senders = [agent for agent in range(agents) if agent not in silent]
        if shuffle is not None:
            shuffle.shuffle(senders)
        for agent in senders:
            payloads = [b"%d/%d" % (agent, slot)] + [b"noise"] * (
                chatter if agent == agents - 1 else 0
            )
            radio.transmit(agent, slot * SLOT_S, transmission(*payloads, channel=slot % 2))
        received.append([radio.collect(agent, (slot + 1) * SLOT_S) for agent in range(agents)])
    return received, radio


def between(received, sources, receivers):
    return [
        [[f for f in slot[agent] if f.source in sources] for agent in receivers]
        for slot in received
    ]


@pytest.mark.parametrize("shuffle_seed", range(5))
def test_the_result_does_not_depend_on_the_order_of_transmissions_within_a_slot(shuffle_seed):
    assert sent()[0] == sent(shuffle=Random(shuffle_seed))[0]


def test_no_frame_arrives_twice():
    received, _ = sent(chatter=3)
    for agent in range(AGENTS):
        counts = Counter((f.source, f.channel, f.count) for slot in received for f in slot[agent])
        assert counts
        assert set(counts.values()) == {1}


def test_frames_due_at_one_time_arrive_in_canonical_order():
    radio = medium(Conditions(delay_ms=10.0))
    for source, incarnation, channel in ((3, 0, 0), (1, 1, 0), (1, 0, 1), (1, 0, 0), (2, 0, 1)):
        radio.transmit(
            source, 0.0, transmission(b"a", b"b", channel=channel, incarnation=incarnation)
        )
    keys = [(f.source, f.incarnation, f.channel, f.count) for f in radio.collect(0, 1.0)]
    assert keys == sorted(keys)
    assert len(keys) == 10


def test_frames_arrive_in_order_of_their_due_times():
    late = DirectedLink(source=1, to=0, delay_ms=30.0)
    radio = medium(Conditions(delay_ms=10.0, link=(late,)))
    radio.transmit(1, 0.0, transmission(b"first sent"))
    radio.transmit(2, 0.01, transmission(b"first due"))
    assert [f.payload for f in radio.collect(0, 1.0)] == [b"first due", b"first sent"]


def test_a_verdict_does_not_depend_on_other_senders():
    quiet = between(sent(silent=(2, 4))[0], (0, 1), (0, 1, 3))
    loud = between(sent(chatter=20)[0], (0, 1), (0, 1, 3))
    assert quiet == loud


def test_a_verdict_does_not_depend_on_the_number_of_agents():
    few, many = sent(agents=5)[0], sent(agents=30)[0]
    common = range(5)
    assert between(few, common, common) == between(many, common, common)


def test_a_verdict_does_not_depend_on_the_other_channel():
    def lost(beacons):
        radio = medium()
        for slot in range(200):
            if beacons:
                radio.transmit(0, slot * SLOT_S, transmission(b"beacon", channel=LOCAL))
            radio.transmit(0, slot * SLOT_S, transmission(b"record", channel=MULTIHOP))
        return [f.count for f in radio.collect(1, 1e9) if f.channel == MULTIHOP]

    assert lost(beacons=True) == lost(beacons=False)


def test_another_incarnation_draws_other_numbers():
    def lost(incarnation):
        radio = medium()
        radio.transmit(0, 0.0, transmission(*[b"x"] * 64, incarnation=incarnation))
        return [f.count for f in radio.collect(1, 1e9)]

    assert lost(0) == lost(0) != lost(1)


def test_the_digest_depends_on_the_seed_alone():
    digests = [sent(seed=seed)[1].digest() for seed in (1, 1, 2, 3)]
    assert digests[0] == digests[1]
    assert len(set(digests)) == 3


def test_one_changed_fate_changes_the_digest():
    near, far = medium(), medium(positions=(*ONE_POINT[:4], (9.0, 0.0, 0.0)))
    for radio in (near, far):
        radio.transmit(0, 0.0, transmission(b"x"))
    assert near.digest() != far.digest()


def test_half_of_100_000_packets_arrive_under_50_percent_loss():
    radio = medium(Conditions(loss_percent=50.0), agents=2)
    received_count = 0
    for slot in range(100_000 // 50):
        radio.transmit(0, slot * SLOT_S, transmission(*[b"x"] * 50))
        received_count += len(radio.collect(1, slot * SLOT_S))
    assert abs(received_count / 100_000 - 0.5) < BOUND
    assert radio.counters(0).fates["dropped_loss"] == 100_000 - received_count


def test_two_receivers_lose_frames_independently():
    radio = medium(Conditions(loss_percent=50.0), agents=3)
    agree = 0
    for slot in range(20_000):
        radio.transmit(0, slot * SLOT_S, transmission(b"x"))
        first, second = (radio.collect(agent, slot * SLOT_S) for agent in (1, 2))
        agree += len(first) == len(second)
    assert abs(agree / 20_000 - 0.5) < 3.29 * 0.5 / 20_000**0.5


def test_range_is_a_hard_disc_round_the_true_position():
    where = ((0.0, 0.0, 0.0), (2.0, 2.0, 1.0), (0.0, 0.0, 3.0 + 1e-9), None)
    radio = medium(Conditions(range_m=3.0), agents=4, positions=where)
    radio.transmit(0, 0.0, transmission(b"x"))
    assert [len(radio.collect(agent, 1.0)) for agent in range(4)] == [0, 1, 0, 0]
    assert radio.counters(0).fates["dropped_range"] == 2


def test_the_position_at_the_time_of_sending_decides():
    near, far = ONE_POINT, (*ONE_POINT[:4], (50.0, 0.0, 0.0))
    radio = medium(Conditions(range_m=3.0, delay_ms=100.0), positions=near)
    radio.transmit(0, 0.0, transmission(b"while near"))
    radio.place(far)
    radio.transmit(0, 0.05, transmission(b"while far"))
    radio.place(near)
    assert [f.payload for f in radio.collect(4, 1.0)] == [b"while near"]


def test_an_absent_radio_neither_sends_nor_receives():
    radio = medium(Conditions(), agents=3, positions=((0.0, 0.0, 0.0), None, (0.0, 0.0, 0.0)))
    radio.transmit(0, 0.0, transmission(b"x"))
    radio.transmit(1, 0.0, transmission(b"y"))
    received = [[f.payload for f in radio.collect(agent, 1.0)] for agent in range(3)]
    assert received == [[], [], [b"x"]]
    assert radio.counters(0).fates["dropped_range"] == 3


def test_before_positions_are_set_no_frame_arrives():
    radio = Medium(MediumSetup(1, 3, 4, 80.0, Conditions()))
    radio.transmit(0, 0.0, transmission(b"x"))
    assert radio.in_flight == 0
    check_conservation(radio)


def test_links_channels_and_both_have_their_own_conditions():
    dead = DirectedLink(source=0, to=1, loss_percent=100.0)
    slow = Conditions(delay_ms=10.0, multihop=LinkKeys(delay_ms=50.0), link=(dead,))
    radio = medium(slow, agents=3)
    for channel in (LOCAL, MULTIHOP):
        radio.transmit(0, 0.0, transmission(b"from 0", channel=channel))
        radio.transmit(1, 0.0, transmission(b"from 1", channel=channel))
    assert radio.collect(1, 1.0) == ()
    assert [f.source for f in radio.collect(0, 0.010)] == [1]
    assert [f.source for f in radio.collect(2, 0.049)] == [0, 1]
    assert [f.channel for f in radio.collect(2, 0.050)] == [MULTIHOP, MULTIHOP]


def test_collect_returns_the_due_time_of_each_frame():
    radio = medium(Conditions(delay_ms=7.0, rate_kbit=8.0, rate_overhead_b=0), agents=2)
    radio.transmit(0, 1.0, transmission(b"first", b"other"))
    due_s = [0.5]
    assert len(radio.collect(1, 2.0, due_s)) == 2
    assert due_s == pytest.approx([0.5, 1.0 + 0.007 + 0.005, 1.0 + 0.007 + 0.010])


@pytest.mark.parametrize(("size_b", "frames"), [(1200, 600), (0, 9000)])
def test_frames_that_do_not_fit_one_batch_arrive_with_the_next(size_b, frames):
    radio = medium(Conditions(), agents=2)
    for at in range(0, frames, 50):
        radio.transmit(0, at * 1e-6, transmission(*[b"x" * size_b] * 50, incarnation=2**53 - 1))
    received = []
    while radio.in_flight:
        batch = Batch(2**53 - 1, radio.collect(1, 1.0))
        assert 0 < len(batch.frames) <= MAX_FRAMES
        assert unpack_batch(pack(batch)) == batch
        assert len(pack(batch)) <= MAX_BATCH_B
        received += batch.frames
        check_conservation(radio)
    assert [frame.count for frame in received] == list(range(frames))
