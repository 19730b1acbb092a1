"""Whatever bytes come, the codec gives back a message that keeps its promises, or refuses it."""

from math import inf, isfinite, nan
from random import Random

import msgpack
import msgspec
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from agent.codec import (
    MAX_MESSAGE_B,
    MAX_OBSERVATION_B,
    SEAL_B,
    RejectedError,
    decode_beacon,
    decode_command,
    decode_gossip,
    decode_observation,
    encode,
    sealed,
)
from agent.messages import CAUSES as CAUSES_TOLD
from agent.messages import (
    Beacon,
    Command,
    Drift,
    FramePath,
    Gossip,
    Mission,
    Observation,
    Piece,
    Pose,
    Record,
    Scan,
    Telemetry,
)
from netem.wire.channels import MAX_PAYLOAD_B

MANY = 15_000
VECTOR = (1.0, -2.5, 0.25)
POSE = Pose(1.0, 2.0, 3.0, 0.5)
SCAN = Scan(1, bytes(8))
DRIFT = Drift(1.5, 0.1, 0.2, 0.3, 0.4)
PATH = FramePath((VECTOR, VECTOR), 0.25, 2.0, 0.5, 0.2, (1.0, 2.0))
TELEMETRY = Telemetry(VECTOR, 1.0, VECTOR, (1, 2), (3, 4), ((5, 5),), 6, 1, 3, 0)
RECORD = Record(4, 0, 77, 1.25, VECTOR, -1, -1, 0, 7, ((0, 0),))
GOOD = {
    Observation: Observation(
        7, 1.5, VECTOR, VECTOR, 0.5, (VECTOR, VECTOR), (VECTOR,), (Mission(0, PATH, b""),), (SCAN,)
    ),
    Command: Command(
        7,
        1,
        9,
        VECTOR,
        0.5,
        (0.1, 0.2),
        Telemetry(VECTOR, 1.0, VECTOR, (1, 2), (3, 4), ((5, 5),), 6, 1, 3, 0),
    ),
    Beacon: Beacon(
        3,
        1,
        900,
        1.5,
        VECTOR,
        VECTOR,
        VECTOR,
        1,
        2,
        850,
        0.5,
        ((1, 900), (2, 901)),
        7,
        7,
        POSE,
        DRIFT,
        1,
        4,
        900,
        ((0, 0),),
    ),
    Gossip: Gossip(
        3,
        1.5,
        (RECORD,) * 3,
        Piece(7, 0, 1, b"x"),
    ),
}
DECODE = {
    Observation: decode_observation,
    Command: decode_command,
    Beacon: lambda data: decode_beacon(sealed(data)),
    Gossip: lambda data: decode_gossip(sealed(data)),
}
LIMIT_B = {
    Observation: MAX_OBSERVATION_B,
    Command: MAX_MESSAGE_B,
    Beacon: MAX_PAYLOAD_B - SEAL_B,
    Gossip: MAX_PAYLOAD_B - SEAL_B,
}
KINDS = pytest.mark.parametrize("kind", GOOD, ids=lambda kind: kind.__name__)
CAUSES = {"oversize", "garbage", "invalid"}

counts = st.integers(0, 2**53 - 1)
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
poses = st.builds(Pose, metres, metres, metres, angles)
blocked = st.lists(st.tuples(indices, indices), max_size=8).map(tuple)
drifts = st.builds(Drift, seconds, speeds, speeds, speeds, angles)
rates = st.floats(1e-6, 100.0)
paths = st.builds(
    FramePath,
    st.lists(positions, min_size=1, max_size=3).map(tuple),
    rates,
    seconds,
    angles,
    rates,
    st.lists(seconds, max_size=3).map(tuple),
)
scans = st.builds(Scan, st.integers(0, 7), st.binary(max_size=200))
missions = st.builds(Mission, counts, paths, st.binary(max_size=900))
pieces = st.builds(Piece, counts, st.integers(0, 15), st.integers(1, 16), st.binary(max_size=900))
records = st.builds(
    Record, ids, counts, counts, seconds, positions, indices, indices, costs, counts, blocked
)
telemetries = st.builds(
    Telemetry,
    velocities,
    st.floats(0.0, 1e9),
    st.none() | positions,
    st.none() | st.tuples(indices, indices),
    st.lists(ids, max_size=20).map(tuple),
    st.lists(st.tuples(st.integers(0, len(CAUSES_TOLD) - 1), counts), max_size=8).map(tuple),
    counts,
    indices,
    parents,
    st.integers(0, 3),
)
messages = st.one_of(
    st.builds(
        Observation,
        counts,
        seconds,
        positions,
        velocities,
        angles,
        st.lists(positions, max_size=9).map(tuple),
        st.lists(positions, max_size=4).map(tuple),
        st.lists(missions, max_size=1).map(tuple),
        st.lists(scans, max_size=2).map(tuple),
    ),
    st.builds(
        Command, counts, counts, counts, velocities, angles, st.tuples(angles, angles), telemetries
    ),
    st.builds(
        Beacon,
        ids,
        counts,
        counts,
        seconds,
        positions,
        velocities,
        positions,
        indices,
        indices,
        costs,
        st.floats(0.0, 100.0),
        st.lists(st.tuples(ids, counts), max_size=20).map(tuple),
        counts,
        counts,
        poses,
        st.none() | drifts,
        indices,
        parents,
        counts,
        blocked,
    ),
    st.builds(Gossip, ids, seconds, st.lists(records, max_size=8).map(tuple), st.none()),
    st.builds(Gossip, ids, seconds, st.just(()), pieces),
)


def numbers(value):
    """Every float in a message, however deep."""
    if isinstance(value, float):
        yield value
    elif isinstance(value, list | tuple):
        for inner in value:
            yield from numbers(inner)


def cause(kind, data):
    with pytest.raises(RejectedError) as caught:
        DECODE[kind](data)
    return caught.value.cause


def survives(kind, data):
    """Return the message, or None where it is refused; anything else ends the test."""
    try:
        message = DECODE[kind](data)
    except RejectedError as error:
        assert error.cause in CAUSES
        return None
    assert isinstance(message, kind)
    assert all(map(isfinite, numbers(msgspec.to_builtins(message))))
    assert DECODE[kind](encode(message)) == message
    return message


@settings(derandomize=True, deadline=None, max_examples=300)
@given(messages)
def test_a_message_survives_its_codec(message):
    assert DECODE[type(message)](encode(message)) == message


@KINDS
def test_junk_is_refused(kind):
    random = Random(1)
    for _ in range(MANY):
        survives(kind, random.randbytes(random.randrange(0, 80)))


@KINDS
def test_mutations_are_refused_or_still_keep_the_promise(kind):
    random, whole, refused = Random(2), encode(GOOD[kind]), 0
    for _ in range(MANY):
        data = bytearray(whole)
        for _ in range(random.randrange(1, 4)):
            data[random.randrange(len(data))] = random.randrange(256)
        if random.random() < 0.2:
            del data[random.randrange(len(data)) :]
        refused += survives(kind, bytes(data)) is None
    assert refused > MANY // 4


@pytest.mark.parametrize("decode_radio", [decode_beacon, decode_gossip])
def test_a_turned_bit_is_seen_wherever_it_is(decode_radio):
    payload = sealed(encode(GOOD[Beacon if decode_radio is decode_beacon else Gossip]))
    assert decode_radio(payload) in GOOD.values()
    for bit in range(8 * len(payload)):
        turned = bytearray(payload)
        turned[bit // 8] ^= 1 << bit % 8
        with pytest.raises(RejectedError) as caught:
            decode_radio(bytes(turned))
        assert caught.value.cause == "corrupt"


@given(st.binary(max_size=10))
def test_what_is_too_short_for_a_seal_or_has_none_is_corrupt(payload):
    for decode_radio in (decode_beacon, decode_gossip):
        with pytest.raises(RejectedError) as caught:
            decode_radio(payload)
        assert caught.value.cause == "corrupt" or payload == sealed(payload[:-SEAL_B])


@KINDS
def test_a_part_of_a_message_is_garbage(kind):
    whole = encode(GOOD[kind])
    assert {cause(kind, whole[:cut]) for cut in range(len(whole))} == {"garbage"}
    assert cause(kind, whole + b"\x00") == "garbage"


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
def test_any_structure_is_refused_or_keeps_the_promise(value):
    data = msgpack.packb(value)
    for kind in GOOD:
        survives(kind, data)


def replaced(value, path, other):
    """Return nested tuples with one element replaced."""
    if not path:
        return other
    at, *rest = path
    return (*value[:at], replaced(value[at], rest, other), *value[at + 1 :])


def leaves(value, path=()):
    """Every number's path in nested tuples."""
    if isinstance(value, tuple):
        for at, inner in enumerate(value):
            yield from leaves(inner, (*path, at))
    else:
        yield path, value


def structure(kind):
    """A good message as nested tuples."""
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
def test_a_wrong_value_is_refused_wherever_it_stands(kind, wrong):
    good = structure(kind)
    for path, value in leaves(good):
        if isinstance(value, bytes) and isinstance(wrong, bytes):
            continue
        refused_as = cause(kind, msgpack.packb(replaced(good, path, wrong)))
        assert refused_as == "invalid"


@KINDS
def test_a_float_for_a_whole_number_is_refused(kind):
    good = structure(kind)
    for path, value in leaves(good):
        if isinstance(value, int):
            assert cause(kind, msgpack.packb(replaced(good, path, float(value)))) == "invalid"


@KINDS
def test_a_field_too_few_or_too_many_is_refused(kind):
    good = structure(kind)
    for other in (good[:-1], (*good, 0), (*good, None), {}, dict.fromkeys("abc", 0), (), None, 1):
        assert cause(kind, msgpack.packb(other)) == "invalid"


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
    "text that is none": b"\xa2\xff\xfe",
    "a reserved byte": b"\xc1",
    "a number for a key": b"\x81\x01\x02",
    "nothing at all": b"",
}


@KINDS
@pytest.mark.parametrize("data", BOMBS.values(), ids=BOMBS)
def test_a_bomb_is_garbage(kind, data):
    assert cause(kind, data) in {"garbage", "invalid"}


@KINDS
def test_what_is_too_large_is_not_even_decoded(kind, monkeypatch):
    monkeypatch.setattr(msgpack, "unpackb", lambda *_, **__: pytest.fail("it was decoded"))
    assert cause(kind, bytes(LIMIT_B[kind] + 1)) == "oversize"


def test_lists_longer_than_allowed_are_refused():
    good = GOOD[Beacon]
    many = msgspec.structs.replace(good, echoes=((1, 1),) * 129)
    assert cause(Beacon, encode(many)) == "invalid"
    told = msgspec.structs.replace(GOOD[Command].telemetry, heard=(1,) * 257)
    assert cause(Command, encode(msgspec.structs.replace(GOOD[Command], telemetry=told))) == (
        "invalid"
    )


def test_messages_cannot_be_changed():
    with pytest.raises(AttributeError):
        GOOD[Beacon].sequence = 1
