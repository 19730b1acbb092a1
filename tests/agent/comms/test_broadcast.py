"""Broadcasts: on time, numbered, and never longer than a frame may be."""

from itertools import pairwise
from math import inf

import pytest

from agent.codec import RadioCodec, decode_beacon, decode_gossip
from agent.comms.broadcast import MAX_ECHOES, Broadcast, OwnState
from agent.comms.gossip import RecordTable
from agent.config import Comms
from agent.messages import (
    FRAME_M,
    MAX_PLACES,
    MAX_VERTICES,
    Branch,
    Drift,
    Place,
    Pose,
    RootKey,
    Standing,
    Summary,
    Swap,
    Vector,
)
from netem.wire.channels import LOCAL, MAX_PAYLOAD_B, MULTIHOP
from tests.agent.comms.builders import (
    FAR,
    GREATEST,
    LATE_S,
    ORIGIN,
    gossip,
    greatest_record,
    record,
)


def at_rest(
    position: Vector = ORIGIN, place: Place | None = None, summary: Summary | None = None
) -> OwnState:
    return OwnState(
        position=position,
        velocity=ORIGIN,
        heading_for=ORIGIN,
        place=place,
        speed_cap=0.5,
        summary=summary,
    )


STILL = at_rest()
FARTHEST = Place(2**15 - 1, 2**15 - 1)
SWAP = Swap(partner=2**16 - 1, place=FARTHEST, other=FARTHEST)
BRANCH = Branch(
    root=RootKey(cost_cm=2**31 - 1, id=2**16 - 1),
    version=GREATEST,
    tier=2**15 - 1,
    parent=2**16 - 1,
)
SUMMARY = Summary(mission=1, first=0, labels=bytes(4), news=(), trees=())
EXTREME = OwnState(
    position=(FAR,) * 3,
    velocity=(-99.9,) * 3,
    heading_for=(FAR,) * 3,
    place=FARTHEST,
    speed_cap=99.9,
    mission=GREATEST,
    frame_key=GREATEST,
    frame=Pose(x=FRAME_M, y=FRAME_M, z=FRAME_M, yaw=99.9),
    drift=Drift(stamp_s=LATE_S, x=99.9, y=99.9, z=99.9, yaw_rate=99.9),
    blocked=(FARTHEST,) * MAX_PLACES,
    cost_mm=2**31 - 1,
    standing=Standing(
        branches=(BRANCH,) * MAX_VERTICES,
        leads=2**15 - 1,
        queue=2**15 - 1,
        heard=2**16 - 1,
        pushes=True,
        proposal=SWAP,
        reservation=SWAP,
        code=255,
    ),
)


def broadcast(beacon_s=0.05, round_s=0.5, incarnation=0, relays=True, own_id=3):
    comms = Comms(local_hz=1.0 / beacon_s, multihop_hz=1.0 / round_s)
    return Broadcast(own_id, incarnation, comms, RadioCodec(), relays)


def table_with(own_id, records):
    table, now_s = RecordTable(own_id, 2.0), max(each.stamp_s for each in records)
    table.adopt(gossip(9, now_s, records), now_s, 0.1)
    return table


@pytest.mark.parametrize(("beacon_s", "ticks"), [(0.05, 1), (0.1, 2), (0.2, 4)])
def test_beacons_are_sent_at_their_rate(beacon_s, ticks):
    sender, table = broadcast(beacon_s), RecordTable(3, 2.0)
    times = [
        tick
        for tick in range(200)
        for channel, _ in sender.frames(tick * 0.05, STILL, (), table)
        if channel == LOCAL
    ]
    assert {b - a for a, b in pairwise(times)} == {ticks}


def test_rounds_are_sent_at_their_rate_and_not_at_all_when_off():
    for round_s, wanted in ((0.5, 20), (inf, 0)):
        sender, table = broadcast(round_s=round_s), RecordTable(3, 2.0)
        channels = [
            channel
            for tick in range(200)
            for channel, _ in sender.frames(tick * 0.05, STILL, (), table)
        ]
        assert channels.count(MULTIHOP) == wanted


def test_beacons_are_numbered_and_the_last_sending_times_are_kept():
    sender, table = broadcast(), RecordTable(3, 2.0)
    for tick in range(1000):
        now_s = tick * 0.05
        payload = sender.frames(now_s, STILL, (), table)[0][1]
        sent = decode_beacon(payload)
        assert (sent.id, sent.sequence, sent.stamp_s) == (3, tick + 1, now_s)
        assert sender.sent_s[sent.sequence] == now_s
    assert len(sender.sent_s) == 200


@pytest.mark.parametrize("neighbours", [0, 1, 7, 8, 9, 15, 16, 17, 129, 500])
def test_a_beacon_of_the_greatest_numbers_fits_its_frame(neighbours):
    sender, table = broadcast(incarnation=GREATEST, own_id=2**16 - 1), RecordTable(3, 2.0)
    sender.sequence = GREATEST - 200
    echoes = tuple((2**16 - 1 - k, GREATEST) for k in range(neighbours))
    for tick in range(12):
        payload = sender.frames(LATE_S - 60.0 + tick, EXTREME, echoes, table)[0][1]
        assert len(payload) <= MAX_PAYLOAD_B
        sent = decode_beacon(payload)
        assert sent.standing == EXTREME.standing
        assert len(sent.echoes) == min(neighbours, MAX_ECHOES)


@pytest.mark.parametrize("neighbours", [1, 8, 9, 12, 16, 23, 24, 40, 64, 65, 255])
def test_every_neighbour_is_echoed_in_its_turn(neighbours):
    """Who is echoed more seldom than every ECHO_LASTS_S counts as deaf: no parent."""
    sender, table = broadcast(), RecordTable(3, 2.0)
    echoes = tuple((100 + k, k) for k in range(neighbours))
    sent = [
        {k for _, k in decode_beacon(sender.frames(tick * 0.05, STILL, echoes, table)[0][1]).echoes}
        for tick in range(4 * neighbours)
    ]
    turns = -(-neighbours // MAX_ECHOES) + 1
    for first in range(len(sent) - turns):
        assert set.union(*sent[first : first + turns]) == set(range(neighbours))


def test_each_round_sends_the_whole_table():
    table = table_with(3, [greatest_record(1000 + k) for k in range(1000)])
    frames = broadcast().frames(1.0, EXTREME, (), table)
    payloads = [payload for channel, payload in frames if channel == MULTIHOP]
    assert max(map(len, payloads)) <= MAX_PAYLOAD_B
    echoed = [each.id for payload in payloads for each in decode_gossip(payload).records]
    assert echoed == [3, *range(1000, 2000)]


def test_the_own_record_agrees_with_the_beacon():
    sender, table = broadcast(incarnation=2), table_with(3, [record(4, 9)])
    own = at_rest(position=(1.0, 2.0, 3.0), place=Place(1, 4))
    (_, first), (_, second) = sender.frames(7.0, own, (), table)
    sent, (own_record, other) = decode_beacon(first), decode_gossip(second).records
    assert other == record(4, 9)
    for name in ("id", "incarnation", "stamp_s", "position", "queue", "rank"):
        assert getattr(own_record, name) == getattr(sent, name)
    assert own_record.version == sent.sequence
    assert (sent.queue, sent.rank) == (1, 4)


def test_who_relays_nothing_sends_no_record():
    sender, table = broadcast(relays=False), table_with(3, [record(4, 9)])
    assert [channel for channel, _ in sender.frames(7.0, STILL, (), table)] == [LOCAL]


@pytest.mark.parametrize("relays", [False, True])
def test_a_summary_goes_out_at_once_in_a_frame_of_its_own(relays):
    sender, table = broadcast(relays=relays), RecordTable(3, 2.0)
    sender.frames(7.0, STILL, (), table)
    own = at_rest(summary=SUMMARY)
    ((_, payload),) = [each for each in sender.frames(7.1, own, (), table) if each[0] == MULTIHOP]
    sent = decode_gossip(payload)
    assert (sent.id, sent.stamp_s, sent.records, sent.summary) == (3, 7.1, (), SUMMARY)


def test_no_summary_goes_out_with_the_multihop_channel_off():
    sender, own = broadcast(round_s=inf), at_rest(summary=SUMMARY)
    for tick in range(40):
        assert [c for c, _ in sender.frames(tick * 0.05, own, (), RecordTable(3, 2.0))] == [LOCAL]
