"""Broadcasts: on time, numbered, and never longer than a frame may be."""

from itertools import pairwise
from math import inf

import msgspec
import pytest

from agent.codec import add_checksum, decode_beacon, decode_gossip, encode
from agent.comms.broadcast import Broadcast, OwnState, most_echoes
from agent.comms.gossip import RecordTable
from agent.comms.hierarchy import HierarchyState
from agent.messages import FRAME_M, MAX_PLACES, Drift, Place, Pose
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

STILL = OwnState(position=ORIGIN, velocity=ORIGIN, heading_for=ORIGIN, place=None, speed_cap=0.5)
FARTHEST = Place(2**15 - 1, 2**15 - 1)
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
    hierarchy=HierarchyState(tier=2**15 - 1, parent=2**16 - 1, root=GREATEST, role=3),
    blocked=(FARTHEST,) * MAX_PLACES,
    cost_mm=2**31 - 1,
)


def broadcast(beacon_s=0.05, round_s=0.5, incarnation=0):
    return Broadcast(3, incarnation, beacon_s, round_s)


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


@pytest.mark.parametrize("neighbours", [0, 1, 68, 69, 129, 500])
def test_a_beacon_fits_its_frame_with_any_number_of_neighbours(neighbours):
    sender, table = broadcast(incarnation=GREATEST), RecordTable(3, 2.0)
    echoes = tuple((2**16 - 1 - k, GREATEST) for k in range(neighbours))
    echoed = set()
    for tick in range(12):
        payload = sender.frames(LATE_S - 60.0 + tick, EXTREME, echoes, table)[0][1]
        assert len(payload) <= MAX_PAYLOAD_B
        sent = decode_beacon(payload)
        assert len(sent.echoes) == min(neighbours, most_echoes(MAX_PLACES))
        echoed.update(sent.echoes)
    assert echoed == set(echoes), "every neighbour is echoed in some beacon"


def greatest_beacon_b(places, echoes):
    """Return the size of a beacon of the greatest numbers [B]."""
    echoed = tuple((2**16 - 1 - k, GREATEST) for k in range(echoes))
    own = msgspec.structs.replace(EXTREME, blocked=(FARTHEST,) * places)
    frames = broadcast(incarnation=GREATEST).frames(LATE_S, own, echoed, RecordTable(3, 2.0))
    sent = decode_beacon(frames[0][1])
    extreme = msgspec.structs.replace(sent, id=2**16 - 1, sequence=GREATEST, echoes=echoed)
    return len(add_checksum(encode(extreme)))


@pytest.mark.parametrize("places", range(MAX_PLACES + 1))
def test_the_echoes_fit_beside_the_greatest_numbers(places):
    assert greatest_beacon_b(places, most_echoes(places)) <= MAX_PAYLOAD_B


def test_as_many_echoes_as_possible_fit_beside_eight_places():
    assert greatest_beacon_b(8, most_echoes(8) + 1) > MAX_PAYLOAD_B


def test_each_round_sends_the_whole_table():
    table = table_with(3, [greatest_record(1000 + k) for k in range(1000)])
    frames = broadcast().frames(1.0, EXTREME, (), table)
    payloads = [payload for channel, payload in frames if channel == MULTIHOP]
    assert max(map(len, payloads)) <= MAX_PAYLOAD_B
    echoed = [each.id for payload in payloads for each in decode_gossip(payload).records]
    assert echoed == [3, *range(1000, 2000)]


def test_the_own_record_agrees_with_the_beacon():
    sender, table = broadcast(incarnation=2), table_with(3, [record(4, 9)])
    own = msgspec.structs.replace(STILL, position=(1.0, 2.0, 3.0), place=Place(1, 4))
    (_, first), (_, second) = sender.frames(7.0, own, (), table)
    sent, (own_record, other) = decode_beacon(first), decode_gossip(second).records
    assert other == record(4, 9)
    for name in ("id", "incarnation", "stamp_s", "position", "queue", "rank"):
        assert getattr(own_record, name) == getattr(sent, name)
    assert own_record.version == sent.sequence
    assert (sent.queue, sent.rank) == (1, 4)
