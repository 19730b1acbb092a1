"""The codec: any bytes are decoded to a message within its bounds, or rejected."""

from math import inf, isfinite, nan
from random import Random

import msgpack
import msgspec
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from agent.codec import (
    CHECKED_EVERY,
    CHECKSUM_B,
    MAX_COMMAND_B,
    MAX_OBSERVATION_B,
    RadioCodec,
    add_checksum,
    decode_beacon,
    decode_command,
    decode_gossip,
    decode_observation,
    encode,
)
from agent.messages import (
    CAUSES,
    FRAME_M,
    LEAST_SPEED_MPS,
    MAX_TEAM,
    MAX_VERTICES,
    Beacon,
    Branch,
    Candidate,
    Command,
    Drift,
    FramePath,
    Gossip,
    LeaderSummary,
    Line,
    LinePart,
    Lines,
    Mission,
    Observation,
    Order,
    Piece,
    Pose,
    Record,
    RootKey,
    Scan,
    Standing,
    Subtree,
    Summary,
    Swap,
    Telemetry,
    TreeReport,
)
from agent.rejection import RejectedError
from netem.wire.channels import MAX_PAYLOAD_B

MANY = 15_000
VECTOR = (1.0, -2.5, 0.25)
POSE = Pose(x=1.0, y=2.0, z=3.0, yaw=0.5)
SCAN = Scan(kind=1, ranges=bytes(8))
DRIFT = Drift(stamp_s=1.5, x=0.1, y=0.2, z=0.3, yaw_rate=0.4)
PATH = FramePath(
    waypoints=(VECTOR, VECTOR), speed=0.25, start_s=2.0, yaw=0.5, turn_rate=0.2, waits_s=(1.0, 2.0)
)
TELEMETRY = Telemetry(
    wanted=VECTOR,
    force=1.0,
    target=VECTOR,
    place=(1, 2),
    heard=(3, 4),
    rejected=((5, 5),),
    mission=6,
    tier=1,
    parent=3,
    role=0,
)
RECORD = Record(
    id=4,
    incarnation=0,
    version=77,
    stamp_s=1.25,
    position=VECTOR,
    queue=-1,
    rank=-1,
    cost_mm=0,
    mission=7,
    blocked=((0, 0),),
)
ROOT = RootKey(cost_cm=250, id=3)
STANDING = Standing(
    branches=(Branch(ROOT, version=150, tier=1, parent=3), None),
    leads=-1,
    queue=1,
    heard=4,
    pushes=False,
    proposal=Swap(partner=2, place=(1, 2), other=(1, 3)),
    reservation=None,
    code=5,
)
SUMMARY = Summary(
    mission=7,
    first=2,
    labels=bytes(8),
    news=((3, 700),),
    trees=(
        TreeReport(
            vertex=0,
            tier=1,
            parent=3,
            down=LeaderSummary(
                root=ROOT,
                version=149,
                total=9,
                counts=(2, 2),
                highest=(2, 3),
                histogram=bytes(16),
                go=True,
                order=140,
                orders=(Order(agent=5, queue=0, to=1),),
                blocked=((0, 2),),
            ),
            up=Subtree(
                highest=(2, 0),
                histogram=bytes(16),
                candidates=((Candidate(extra_dm=-7, agent=5, to=1),), ()),
                blocked=(),
            ),
        ),
    ),
)
GOOD = {
    Observation: Observation(
        slot=7,
        time_s=1.5,
        position=VECTOR,
        velocity=VECTOR,
        yaw=0.5,
        vehicles=(VECTOR, VECTOR),
        obstacles=(VECTOR,),
        orders=(Mission(key=0, frame=PATH, formation=b""),),
        scans=(SCAN,),
    ),
    Command: Command(
        slot=7,
        incarnation=1,
        expires_slot=9,
        velocity=VECTOR,
        yaw=0.5,
        tilt=(0.1, 0.2),
        telemetry=TELEMETRY,
    ),
    Beacon: Beacon(
        id=3,
        incarnation=1,
        sequence=900,
        stamp_s=1.5,
        position=VECTOR,
        velocity=VECTOR,
        target=VECTOR,
        queue=1,
        rank=2,
        cost_mm=850,
        speed_cap=0.5,
        echoes=((1, 900), (2, 901)),
        mission=7,
        frame_key=7,
        frame=POSE,
        drift=DRIFT,
        blocked=((0, 0),),
        standing=STANDING,
    ),
    Gossip: Gossip(
        id=3,
        stamp_s=1.5,
        records=(RECORD,) * 3,
        piece=Piece(key=7, index=0, count=1, data=b"x"),
        summary=SUMMARY,
    ),
}
DECODE = {
    Observation: decode_observation,
    Command: decode_command,
    Beacon: lambda data: decode_beacon(add_checksum(data)),
    Gossip: lambda data: decode_gossip(add_checksum(data)),
}
LIMIT_B = {
    Observation: MAX_OBSERVATION_B,
    Command: MAX_COMMAND_B,
    Beacon: MAX_PAYLOAD_B - CHECKSUM_B,
    Gossip: MAX_PAYLOAD_B - CHECKSUM_B,
}
KINDS = pytest.mark.parametrize("kind", GOOD, ids=lambda kind: kind.__name__)
DECODING_CAUSES = {"oversize", "garbage", "invalid"}

counts = st.integers(0, 2**53 - 1)
mission_keys = st.integers(-1, 2**53 - 1)
ids = st.integers(0, 2**16 - 1)
indices = st.integers(-1, 2**15 - 1)
seconds = st.floats(0.0, 1e9)
metres = st.floats(-1e6, 1e6)
positions = st.tuples(metres, metres, metres)
speeds = st.floats(-100.0, 100.0)
velocities = st.tuples(speeds, speeds, speeds)
angles = st.floats(-100.0, 100.0)
parents = st.integers(-1, 2**16 - 1)
costs = st.integers(0, 2**31 - 1)
frame_metres = st.floats(-FRAME_M, FRAME_M)
poses = st.builds(Pose, x=frame_metres, y=frame_metres, z=frame_metres, yaw=angles)
blocked = st.lists(st.tuples(indices, indices), max_size=8).map(tuple)
drifts = st.builds(Drift, stamp_s=seconds, x=speeds, y=speeds, z=speeds, yaw_rate=angles)
rates = st.floats(1e-6, 100.0)
paths = st.builds(
    FramePath,
    waypoints=st.lists(
        st.tuples(frame_metres, frame_metres, frame_metres), min_size=1, max_size=3
    ).map(tuple),
    speed=st.floats(LEAST_SPEED_MPS, 100.0),
    start_s=seconds,
    yaw=angles,
    turn_rate=rates,
    waits_s=st.lists(seconds, max_size=3).map(tuple),
)
scans = st.builds(Scan, kind=st.integers(0, 7), ranges=st.binary(max_size=200))
missions = st.builds(Mission, key=counts, frame=paths, formation=st.binary(max_size=900))
pieces = st.builds(
    Piece,
    key=counts,
    index=st.integers(0, 15),
    count=st.integers(1, 16),
    data=st.binary(max_size=900),
)
records = st.builds(
    Record,
    id=ids,
    incarnation=counts,
    version=counts,
    stamp_s=seconds,
    position=positions,
    queue=indices,
    rank=indices,
    cost_mm=costs,
    mission=mission_keys,
    blocked=blocked,
)
places = st.tuples(indices, indices)
members = st.integers(0, MAX_TEAM)
member_counts = st.lists(members, max_size=6).map(tuple)
roots = st.builds(RootKey, cost_cm=costs, id=ids)
branches = st.builds(Branch, root=roots, version=counts, tier=indices, parent=parents)
swaps = st.builds(Swap, partner=ids, place=places, other=places)
standings = st.builds(
    Standing,
    branches=st.lists(st.none() | branches, max_size=4).map(tuple),
    leads=indices,
    queue=indices,
    heard=members,
    pushes=st.booleans(),
    proposal=st.none() | swaps,
    reservation=st.none() | swaps,
    code=st.integers(1, 255),
)
leader_summaries = st.builds(
    LeaderSummary,
    root=roots,
    version=counts,
    total=members,
    counts=member_counts,
    highest=member_counts,
    histogram=st.binary(max_size=16),
    go=st.booleans(),
    order=counts,
    orders=st.lists(st.builds(Order, agent=ids, queue=indices, to=indices), max_size=3).map(tuple),
    blocked=blocked,
)
candidates = st.builds(Candidate, extra_dm=st.integers(-(2**31), 2**31 - 1), agent=ids, to=indices)
subtrees = st.builds(
    Subtree,
    highest=member_counts,
    histogram=st.binary(max_size=16),
    candidates=st.lists(st.lists(candidates, max_size=3).map(tuple), max_size=3).map(tuple),
    blocked=blocked,
)
reports = st.builds(
    TreeReport,
    vertex=st.integers(0, MAX_VERTICES - 1),
    tier=indices,
    parent=parents,
    down=st.none() | leader_summaries,
    up=st.none() | subtrees,
)
ways = dict.fromkeys("xyz", st.integers(-(2**31), 2**31 - 1))
queues, times = st.integers(0, 2**15 - 1), st.integers(0, 2**32 - 1)
lines = st.builds(
    Lines,
    lines=st.lists(
        st.builds(Line, queue=queues, version=times, leaves=times, arrives=times, **ways),
        max_size=3,
    ).map(tuple),
    parts=st.lists(
        st.builds(LinePart, queue=queues, parent=parents, members=members, ready=members, **ways),
        max_size=3,
    ).map(tuple),
)
summaries = st.builds(
    Summary,
    mission=counts,
    first=ids,
    labels=st.binary(max_size=64),
    news=st.lists(st.tuples(ids, st.integers(0, 2**16 - 1)), max_size=6).map(tuple),
    trees=st.lists(reports, max_size=2).map(tuple),
    lines=st.none() | lines,
)
telemetries = st.builds(
    Telemetry,
    wanted=velocities,
    force=st.floats(0.0, 1e9),
    target=st.none() | positions,
    place=st.none() | st.tuples(indices, indices),
    heard=st.lists(ids, max_size=20).map(tuple),
    rejected=st.lists(st.tuples(st.integers(0, len(CAUSES) - 1), counts), max_size=8).map(tuple),
    mission=mission_keys,
    tier=indices,
    parent=parents,
    role=st.integers(0, 3),
)
messages = st.one_of(
    st.builds(
        Observation,
        slot=counts,
        time_s=seconds,
        position=positions,
        velocity=velocities,
        yaw=angles,
        vehicles=st.lists(positions, max_size=9).map(tuple),
        obstacles=st.lists(positions, max_size=4).map(tuple),
        orders=st.lists(missions, max_size=1).map(tuple),
        scans=st.lists(scans, max_size=2).map(tuple),
    ),
    st.builds(
        Command,
        slot=counts,
        incarnation=counts,
        expires_slot=counts,
        velocity=velocities,
        yaw=angles,
        tilt=st.tuples(angles, angles),
        telemetry=telemetries,
    ),
    st.builds(
        Beacon,
        id=ids,
        incarnation=counts,
        sequence=counts,
        stamp_s=seconds,
        position=positions,
        velocity=velocities,
        target=positions,
        queue=indices,
        rank=indices,
        cost_mm=costs,
        speed_cap=st.floats(0.0, 100.0),
        echoes=st.lists(st.tuples(ids, counts), max_size=20).map(tuple),
        mission=mission_keys,
        frame_key=mission_keys,
        frame=poses,
        drift=st.none() | drifts,
        blocked=blocked,
        standing=st.none() | standings,
    ),
    st.builds(
        Gossip,
        id=ids,
        stamp_s=seconds,
        records=st.lists(records, max_size=8).map(tuple),
        piece=st.none(),
    ),
    st.builds(Gossip, id=ids, stamp_s=seconds, records=st.just(()), piece=pieces),
    st.builds(
        Gossip,
        id=ids,
        stamp_s=seconds,
        records=st.just(()),
        piece=st.none(),
        summary=summaries,
    ),
)


def numbers(value):
    """Yield every float in a message, at any depth."""
    if isinstance(value, float):
        yield value
    elif isinstance(value, list | tuple):
        for inner in value:
            yield from numbers(inner)


def rejection_cause(kind, data):
    with pytest.raises(RejectedError) as caught:
        DECODE[kind](data)
    return caught.value.cause


def decoded_or_none(kind, data):
    """Return the checked message, or None if it is rejected; any other error fails the test."""
    try:
        message = DECODE[kind](data)
    except RejectedError as error:
        assert error.cause in DECODING_CAUSES
        return None
    assert isinstance(message, kind)
    assert all(map(isfinite, numbers(msgspec.to_builtins(message))))
    assert DECODE[kind](encode(message)) == message
    return message


@settings(derandomize=True, deadline=None, max_examples=300)
@given(messages)
def test_a_message_survives_its_codec(message):
    assert DECODE[type(message)](encode(message)) == message


@settings(derandomize=True)
@given(messages)
def test_a_summary_without_lines_is_as_short_as_before_there_were_any(message):
    """Without ``gather``, not one byte more is sent."""
    plain = msgspec.to_builtins(message, builtin_types=(bytes,))
    if isinstance(message, Gossip) and message.summary is not None:
        *before, said = plain[-1]
        plain[-1] = before if said is None else [*before, said]
    assert encode(message) == msgspec.msgpack.encode(plain)


@KINDS
def test_junk_is_rejected(kind):
    random = Random(1)
    for _ in range(MANY):
        decoded_or_none(kind, random.randbytes(random.randrange(0, 80)))


@KINDS
def test_a_mutated_message_is_rejected_or_within_bounds(kind):
    random, whole, rejected = Random(2), encode(GOOD[kind]), 0
    for _ in range(MANY):
        data = bytearray(whole)
        for _ in range(random.randrange(1, 4)):
            data[random.randrange(len(data))] = random.randrange(256)
        if random.random() < 0.2:
            del data[random.randrange(len(data)) :]
        rejected += decoded_or_none(kind, bytes(data)) is None
    assert rejected > MANY // 4


@pytest.mark.parametrize("decode_radio", [decode_beacon, decode_gossip])
def test_a_flipped_bit_is_detected_anywhere(decode_radio):
    payload = add_checksum(encode(GOOD[Beacon if decode_radio is decode_beacon else Gossip]))
    assert decode_radio(payload) in GOOD.values()
    for bit in range(8 * len(payload)):
        turned = bytearray(payload)
        turned[bit // 8] ^= 1 << bit % 8
        with pytest.raises(RejectedError) as caught:
            decode_radio(bytes(turned))
        assert caught.value.cause == "corrupt"


def test_a_codec_knows_the_newest_payloads_and_forgets_the_oldest():
    stamped = [msgspec.structs.replace(GOOD[Gossip], stamp_s=float(k)) for k in range(10)]
    payloads = [add_checksum(encode(each)) for each in stamped]
    codec = RadioCodec(kept=2)
    found = [codec.gossip(each) for each in payloads]
    assert found == stamped
    assert codec.gossip(payloads[-1]) is found[-1]
    assert codec.gossip(payloads[-2]) is found[-2]
    assert codec.gossip(payloads[0]) is not found[0]
    keeping_none = RadioCodec()
    assert keeping_none.gossip(payloads[0]) is not keeping_none.gossip(payloads[0])


def test_a_codec_hands_over_what_it_encoded_and_checks_one_message_of_many():
    codec, gossip, beacon = RadioCodec(kept=2), GOOD[Gossip], GOOD[Beacon]
    payload = codec.encode_gossip(gossip)
    assert payload == add_checksum(encode(gossip))
    assert codec.gossip(payload) is gossip
    heard = codec.beacon(codec.encode_beacon(beacon))
    assert (heard.id, heard.position, heard.stamp_s) == (
        *(beacon.id, beacon.position, beacon.stamp_s),
    )
    wrong = msgspec.structs.replace(gossip, id=-1)
    with pytest.raises(RejectedError):
        for _ in range(CHECKED_EVERY):
            codec.encode_gossip(wrong)
    altered = msgspec.structs.replace(gossip, records=[])  # a tuple comes out
    with pytest.raises(ValueError, match="the codec makes"):
        for _ in range(CHECKED_EVERY):
            codec.encode_gossip(altered)


@given(st.binary(max_size=10))
def test_a_payload_without_a_valid_checksum_is_corrupt(payload):
    for decode_radio in (decode_beacon, decode_gossip):
        with pytest.raises(RejectedError) as caught:
            decode_radio(payload)
        assert caught.value.cause == "corrupt" or payload == add_checksum(payload[:-CHECKSUM_B])


@KINDS
def test_a_truncated_message_is_garbage(kind):
    whole = encode(GOOD[kind])
    assert {rejection_cause(kind, whole[:cut]) for cut in range(len(whole))} == {"garbage"}
    assert rejection_cause(kind, whole + b"\x00") == "garbage"


plain = st.recursive(
    st.none()
    | st.booleans()
    | st.integers(-(2**63), 2**64 - 1)
    | st.floats()
    | st.text(max_size=70)
    | st.binary(max_size=20)
    | st.builds(msgpack.ExtType, st.integers(0, 127), st.binary(max_size=8))
    | st.builds(msgpack.Timestamp, st.integers(0, 2**33), st.integers(0, 999_999_999)),
    lambda inner: st.lists(inner, max_size=6) | st.dictionaries(st.text(), inner, max_size=3),
    max_leaves=15,
)


@settings(derandomize=True, deadline=None, max_examples=400)
@given(plain)
def test_any_structure_is_rejected_or_within_bounds(value):
    data = msgpack.packb(value)
    for kind in GOOD:
        decoded_or_none(kind, data)


def replaced(value, path, other):
    """Return nested tuples with one element replaced."""
    if not path:
        return other
    at, *rest = path
    return (*value[:at], replaced(value[at], rest, other), *value[at + 1 :])


def leaves(value, path=()):
    """Yield (path, value) of every leaf in nested tuples."""
    if isinstance(value, tuple):
        for at, inner in enumerate(value):
            yield from leaves(inner, (*path, at))
    else:
        yield path, value


def structure(kind):
    """Return a good message as nested tuples."""
    return msgpack.unpackb(encode(GOOD[kind]), use_list=False)


WRONG = {
    "not a number": nan,
    "infinity": inf,
    "minus infinity": -inf,
    "too great": 1e300,
    "too great a whole": 2**63,
    "a bool": True,
    "text": "1",
    "bytes": b"1",
    "a map": {"x": 1},
    "a timestamp": msgpack.Timestamp(1, 0),
    "an empty extension": msgpack.ExtType(5, b""),
}


@KINDS
@pytest.mark.parametrize("wrong", WRONG.values(), ids=WRONG)
def test_a_wrong_value_is_rejected_in_any_field(kind, wrong):
    good = structure(kind)
    for path, value in leaves(good):
        if isinstance(value, bytes | bool) and isinstance(wrong, type(value)):
            continue
        cause = rejection_cause(kind, msgpack.packb(replaced(good, path, wrong)))
        assert cause == "invalid"


@KINDS
def test_a_float_for_a_whole_number_is_rejected(kind):
    good = structure(kind)
    for path, value in leaves(good):
        if isinstance(value, int):
            assert (
                rejection_cause(kind, msgpack.packb(replaced(good, path, float(value))))
                == "invalid"
            )


@KINDS
def test_a_missing_or_extra_field_is_rejected(kind):
    good = structure(kind)
    required = sum(field.required for field in msgspec.structs.fields(kind))
    for other in (
        good[: required - 1],
        (*good, 0),
        (*good, None),
        {},
        dict.fromkeys("abc", 0),
        (),
        None,
        1,
    ):
        assert rejection_cause(kind, msgpack.packb(other)) == "invalid"


BOMBS = {
    "deep arrays": b"\x91" * 1100 + b"\x00",
    "deep maps": b"\x81\xa1a" * 380 + b"\x00",
    "four thousand million items": b"\xdd\xff\xff\xff\xff",
    "four thousand million pairs": b"\xdf\xff\xff\xff\xff",
    "4 GiB of bytes": b"\xc6\xff\xff\xff\xff",
    "4 GiB of text": b"\xdb\xff\xff\xff\xff",
    "4 GiB of extension": b"\xc9\xff\xff\xff\xff\x05",
    "a short timestamp": b"\xd6\xff\x00\x00\x00\x01",
    "an empty timestamp": b"\xc7\x00\xff",
    "invalid text": b"\xa2\xff\xfe",
    "a reserved byte": b"\xc1",
    "a number for a key": b"\x81\x01\x02",
    "no data": b"",
}


@KINDS
@pytest.mark.parametrize("data", BOMBS.values(), ids=BOMBS)
def test_a_bomb_is_garbage(kind, data):
    assert rejection_cause(kind, data) in {"garbage", "invalid"}


@KINDS
def test_an_oversize_message_is_rejected_before_decoding(kind, monkeypatch):
    monkeypatch.setattr(msgpack, "unpackb", lambda *_, **__: pytest.fail("it was decoded"))
    assert rejection_cause(kind, bytes(LIMIT_B[kind] + 1)) == "oversize"


def test_no_mission_is_one_value_and_a_piece_always_has_a_key():
    for key, taken in ((-1, True), (-2, False), (2**53 - 1, True), (2**53, False)):
        for field in ("mission", "frame_key"):
            sent = encode(msgspec.structs.replace(GOOD[Beacon], **{field: key}))
            assert (decoded_or_none(Beacon, sent) is not None) == taken
    piece = Piece(key=-1, index=0, count=1, data=b"")
    sent = encode(msgspec.structs.replace(GOOD[Gossip], piece=piece))
    assert rejection_cause(Gossip, sent) == "invalid"


@pytest.mark.parametrize(("code", "taken"), [(0, False), (1, True), (255, True), (256, False)])
def test_the_code_of_a_member_of_which_nothing_is_known_is_nobodys_own(code, taken):
    """A leader that heard such a member would wait for ever until it is counted."""
    standing = msgspec.structs.replace(STANDING, code=code)
    sent = encode(msgspec.structs.replace(GOOD[Beacon], standing=standing))
    assert (decoded_or_none(Beacon, sent) is not None) == taken


def test_lists_longer_than_allowed_are_rejected():
    good = GOOD[Beacon]
    many = msgspec.structs.replace(good, echoes=((1, 1),) * 129)
    assert rejection_cause(Beacon, encode(many)) == "invalid"
    telemetry = msgspec.structs.replace(GOOD[Command].telemetry, heard=(1,) * 257)
    assert rejection_cause(
        Command, encode(msgspec.structs.replace(GOOD[Command], telemetry=telemetry))
    ) == ("invalid")


def test_messages_are_immutable():
    with pytest.raises(AttributeError):
        GOOD[Beacon].sequence = 1
