"""What an agent says: on time, numbered, and never more than a frame may hold."""

from itertools import pairwise
from math import inf

import msgspec
import pytest

from agent.codec import decode_beacon, decode_gossip, encode, sealed
from agent.comms.broadcast import MAX_ECHOES, Broadcast, OwnState
from agent.comms.gossip import Table
from agent.comms.hierarchy import Standing
from agent.messages import Drift, Gossip, Place, Pose
from netem.wire.channels import LOCAL, MAX_PAYLOAD_B, MULTIHOP
from tests.agent.comms.making import FAR, GREATEST, LATE_S, ORIGIN, greatest_record, record

STILL = OwnState(ORIGIN, ORIGIN, ORIGIN, None, 0.5)
FARTHEST = Place(2**15 - 1, 2**15 - 1)
EXTREME = OwnState(
    (FAR,) * 3,
    (-99.9,) * 3,
    (FAR,) * 3,
    FARTHEST,
    99.9,
    GREATEST,
    GREATEST,
    Pose(FAR, FAR, FAR, 99.9),
    Drift(LATE_S, 99.9, 99.9, 99.9, 99.9),
    Standing(2**15 - 1, 2**16 - 1, GREATEST, 3),
    (FARTHEST,) * 8,
    2**31 - 1,
)


def speaker(beacon_s=0.05, round_s=0.5, incarnation=0):
    return Broadcast(3, incarnation, beacon_s, round_s)


def heard(table_of, records):
    table, now_s = Table(table_of, 2.0), max(each.stamp_s for each in records)
    table.adopt(Gossip(9, now_s, tuple(records), None), now_s, 0.1)
    return table


@pytest.mark.parametrize(("beacon_s", "ticks"), [(0.05, 1), (0.1, 2), (0.2, 4)])
def test_beacons_go_out_at_their_rate(beacon_s, ticks):
    voice, table = speaker(beacon_s), Table(3, 2.0)
    times = [
        tick
        for tick in range(200)
        for channel, _ in voice.frames(tick * 0.05, STILL, (), table)
        if channel == LOCAL
    ]
    assert {b - a for a, b in pairwise(times)} == {ticks}


def test_rounds_go_out_at_their_rate_and_not_at_all_when_off():
    for round_s, wanted in ((0.5, 20), (inf, 0)):
        voice, table = speaker(round_s=round_s), Table(3, 2.0)
        channels = [
            channel
            for tick in range(200)
            for channel, _ in voice.frames(tick * 0.05, STILL, (), table)
        ]
        assert channels.count(MULTIHOP) == wanted


def test_beacons_are_numbered_and_their_times_remembered_for_a_while():
    voice, table = speaker(), Table(3, 2.0)
    for tick in range(1000):
        now_s = tick * 0.05
        payload = voice.frames(now_s, STILL, (), table)[0][1]
        said = decode_beacon(payload)
        assert (said.id, said.sequence, said.stamp_s) == (3, tick + 1, now_s)
        assert voice.sent_s[said.sequence] == now_s
    assert len(voice.sent_s) == 200


@pytest.mark.parametrize("neighbours", [0, 1, 68, 69, 129, 500])
def test_a_beacon_fits_its_frame_however_many_are_heard(neighbours):
    voice, table = speaker(incarnation=GREATEST), Table(3, 2.0)
    echoes = tuple((2**16 - 1 - k, GREATEST) for k in range(neighbours))
    told = set()
    for tick in range(12):
        payload = voice.frames(LATE_S - 60.0 + tick, EXTREME, echoes, table)[0][1]
        assert len(payload) <= MAX_PAYLOAD_B
        said = decode_beacon(payload)
        assert len(said.echoes) == min(neighbours, MAX_ECHOES)
        told.update(said.echoes)
    assert told == set(echoes), "each is echoed in its turn"


def test_as_many_echoes_as_possible_fit_beside_the_greatest_numbers():
    def size_b(echoes):
        told = tuple((2**16 - 1 - k, GREATEST) for k in range(echoes))
        payload = speaker(incarnation=GREATEST).frames(LATE_S, EXTREME, told, Table(3, 2.0))[0][1]
        said = decode_beacon(payload)
        extreme = msgspec.structs.replace(said, id=2**16 - 1, sequence=GREATEST, echoes=told)
        return len(sealed(encode(extreme)))

    assert size_b(MAX_ECHOES) <= MAX_PAYLOAD_B < size_b(MAX_ECHOES + 1)


def test_the_whole_table_goes_out_each_round():
    table = heard(3, [greatest_record(1000 + k) for k in range(1000)])
    frames = speaker().frames(1.0, EXTREME, (), table)
    payloads = [payload for channel, payload in frames if channel == MULTIHOP]
    assert max(map(len, payloads)) <= MAX_PAYLOAD_B
    told = [each.id for payload in payloads for each in decode_gossip(payload).records]
    assert told == [3, *range(1000, 2000)]


def test_the_own_record_is_what_the_beacon_says():
    voice, table = speaker(incarnation=2), heard(3, [record(4, 9)])
    own = OwnState((1.0, 2.0, 3.0), ORIGIN, ORIGIN, Place(1, 4), 0.5)
    (_, first), (_, second) = voice.frames(7.0, own, (), table)
    said, (told, other) = decode_beacon(first), decode_gossip(second).records
    assert other == record(4, 9)
    for name in ("id", "incarnation", "stamp_s", "position", "queue", "rank"):
        assert getattr(told, name) == getattr(said, name)
    assert told.version == said.sequence
    assert (said.queue, said.rank) == (1, 4)
