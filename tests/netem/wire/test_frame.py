"""Any bytes decode into a message that keeps the promises of its type, or raise WireError."""

from math import inf, nan
from random import Random

import msgpack
import msgspec
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from netem.wire.channels import MAX_PAYLOAD_B
from netem.wire.frame import (
    BATCH_HEAD_B,
    FRAME_HEAD_B,
    MAX_BATCH_B,
    MAX_DELIVERY_B,
    MAX_EARLY_US,
    MAX_FRAMES,
    MAX_OUTGOING,
    MAX_TRANSMISSION_B,
    Batch,
    Delivery,
    Frame,
    Outgoing,
    Transmission,
    WireError,
    pack,
    unpack_batch,
    unpack_delivery,
    unpack_transmission,
)

MANY = 20_000
GREATEST = 2**53 - 1
READERS = [
    (unpack_transmission, Transmission),
    (unpack_batch, Batch),
    (unpack_delivery, Delivery),
]
READER_OF = {kind: reader for reader, kind in READERS}

counts = st.integers(0, GREATEST)
channels = st.integers(0, 1)
payloads = st.binary(max_size=MAX_PAYLOAD_B)
transmissions = st.builds(
    Transmission,
    counts,
    counts,
    st.lists(st.builds(Outgoing, channels, payloads), max_size=8).map(tuple),
)
batches = st.builds(
    Batch,
    counts,
    st.lists(
        st.builds(Frame, st.integers(0, 2**16 - 1), counts, channels, counts, payloads), max_size=8
    ).map(tuple),
)


def kept(message):
    """Whether a message keeps the promises of its type: it survives its own codec unchanged."""
    return READER_OF[type(message)](pack(message)) == message


def survives(reader, kind, data):
    """Return the decoded message or None; any error but WireError fails the test."""
    try:
        message = reader(data)
    except WireError:
        return None
    assert isinstance(message, kind)
    assert kept(message)
    return message


@settings(derandomize=True, deadline=None, max_examples=150)
@given(transmissions)
def test_a_transmission_survives_the_wire(transmission):
    assert unpack_transmission(pack(transmission)) == transmission


@settings(derandomize=True, deadline=None, max_examples=150)
@given(batches)
def test_a_batch_survives_the_wire(batch):
    assert unpack_batch(pack(batch)) == batch


def test_the_greatest_transmission_survives_the_wire():
    full = (Outgoing(1, b"x" * MAX_PAYLOAD_B),) * MAX_OUTGOING
    transmission = Transmission(GREATEST, GREATEST, full)
    assert len(pack(transmission)) == MAX_TRANSMISSION_B
    assert unpack_transmission(pack(transmission)) == transmission


def test_the_size_of_a_batch_is_the_sum_of_its_parts():
    frame = Frame(2**16 - 1, GREATEST, 1, GREATEST, b"x" * MAX_PAYLOAD_B)
    batch = Batch(GREATEST, (frame,) * 4000)
    assert len(pack(batch)) == BATCH_HEAD_B + 4000 * (FRAME_HEAD_B + MAX_PAYLOAD_B)


@settings(derandomize=True, deadline=None, max_examples=150)
@given(batches, st.data())
def test_a_delivery_is_a_batch_with_a_time_for_each_frame(batch, data):
    size = len(batch.frames)
    early_us = tuple(data.draw(st.lists(st.integers(0, MAX_EARLY_US), max_size=10)))
    delivery = Delivery(batch.slot, batch.frames, early_us)
    if len(early_us) == size:
        assert unpack_delivery(pack(delivery)) == delivery
    else:
        with pytest.raises(WireError, match="due times for"):
            unpack_delivery(pack(delivery))
    with pytest.raises(WireError):
        unpack_batch(pack(delivery))
    with pytest.raises(WireError):
        unpack_delivery(pack(batch))


def test_the_greatest_delivery_survives_the_wire():
    room_b = (MAX_BATCH_B - BATCH_HEAD_B) // MAX_FRAMES - FRAME_HEAD_B
    frame = Frame(2**16 - 1, GREATEST, 1, GREATEST, b"x" * room_b)
    delivery = Delivery(GREATEST, (frame,) * MAX_FRAMES, (MAX_EARLY_US,) * MAX_FRAMES)
    assert len(pack(delivery)) <= MAX_DELIVERY_B
    assert unpack_delivery(pack(delivery)) == delivery


@pytest.mark.parametrize(("reader", "kind"), READERS)
def test_junk_is_refused(reader, kind):
    random = Random(1)
    for _ in range(MANY):
        survives(reader, kind, random.randbytes(random.randrange(0, 60)))


@pytest.mark.parametrize(("reader", "kind"), READERS)
def test_junk_with_a_valid_start_is_refused(reader, kind):
    random = Random(2)
    for _ in range(MANY):
        head = bytes([0x90 + random.randrange(16), random.randrange(256), random.randrange(256)])
        survives(reader, kind, head + random.randbytes(random.randrange(0, 40)))


@pytest.mark.parametrize(
    ("reader", "kind", "good"),
    [
        (unpack_transmission, Transmission, Transmission(7, 1, (Outgoing(0, b"abcdefgh"),) * 3)),
        (unpack_batch, Batch, Batch(7, (Frame(3, 1, 1, 900, b"abcdefgh"),) * 3)),
        (unpack_delivery, Delivery, Delivery(7, (Frame(3, 1, 1, 9, b"ab"),) * 2, (900, 0))),
    ],
)
def test_mutations_are_refused_or_still_keep_the_promise(reader, kind, good):
    random, whole, refused = Random(3), pack(good), 0
    for _ in range(MANY):
        data = bytearray(whole)
        for _ in range(random.randrange(1, 4)):
            data[random.randrange(len(data))] = random.randrange(256)
        if random.random() < 0.2:
            del data[random.randrange(len(data)) :]
        refused += survives(reader, kind, bytes(data)) is None
    assert refused > MANY // 4


@pytest.mark.parametrize("cut", range(len(pack(Batch(7, (Frame(3, 1, 1, 900, b"abc"),))))))
def test_a_truncated_message_is_refused(cut):
    with pytest.raises(WireError):
        unpack_batch(pack(Batch(7, (Frame(3, 1, 1, 900, b"abc"),)))[:cut])


plain = st.recursive(
    st.none()
    | st.booleans()
    | st.integers(-(2**63), 2**64 - 1)
    | st.floats()
    | st.text(max_size=70)
    | st.binary(max_size=20)
    | st.builds(msgpack.ExtType, st.integers(0, 127), st.binary(max_size=8))
    | st.builds(msgpack.Timestamp, st.integers(0, 2**33), st.integers(0, 999_999_999)),
    lambda inner: (
        st.lists(inner, max_size=5) | st.dictionaries(st.integers() | st.text(), inner, max_size=3)
    ),
    max_leaves=12,
)


@settings(derandomize=True, deadline=None, max_examples=400)
@given(plain)
def test_any_structure_is_refused_or_keeps_the_promise(value):
    try:
        data = msgpack.packb(value)
    except OverflowError:
        return
    for reader, kind in READERS:
        survives(reader, kind, data)


WRONG = {
    "a bool for a number": (True, 0, ()),
    "a float for a count": (1.0, 0, ()),
    "a negative count": (-1, 0, ()),
    "a count too great": (2**53, 0, ()),
    "not a number": (nan, 0, ()),
    "infinity": (inf, 0, ()),
    "text for a number": ("1", 0, ()),
    "nothing for a number": (None, 0, ()),
    "a field too few": (1, 0),
    "a field too many": (1, 0, (), 0),
    "a map for an array": {"slot": 1, "incarnation": 0, "frames": ()},
    "a map for frames": (1, 0, {}),
    "a map for a frame": (1, 0, ({"channel": 0, "payload": b""},)),
    "text for a payload": (1, 0, ((0, "aGVsbG8="),)),
    "numbers for a payload": (1, 0, ((0, (1, 2)),)),
    "an unknown channel": (1, 0, ((2, b""),)),
    "a payload too long": (1, 0, ((0, b"x" * (MAX_PAYLOAD_B + 1)),)),
    "too many frames": (1, 0, ((0, b""),) * (MAX_OUTGOING + 1)),
    "an extension for a payload": (1, 0, ((0, msgpack.ExtType(5, b"")),)),
    "a timestamp": (msgpack.Timestamp(1, 0), 0, ()),
    "a number for a message": 1,
    "nothing": None,
}


@pytest.mark.parametrize("value", WRONG.values(), ids=WRONG)
def test_a_wrong_type_is_refused(value):
    with pytest.raises(WireError):
        unpack_transmission(msgpack.packb(value))


BOMBS = {
    "deep arrays": b"\x91" * 5000 + b"\x00",
    "deep maps": b"\x81\xa1a" * 5000 + b"\x00",
    "four thousand million items": b"\xdd\xff\xff\xff\xff",
    "four thousand million pairs": b"\xdf\xff\xff\xff\xff",
    "4 GiB of bytes": b"\xc6\xff\xff\xff\xff",
    "4 GiB of text": b"\xdb\xff\xff\xff\xff",
    "4 GiB of extension": b"\xc9\xff\xff\xff\xff\x05",
    "a short timestamp": b"\xd6\xff\x00\x00\x00\x01",
    "an empty timestamp": b"\xc7\x00\xff",
    "text that is not UTF-8": b"\xa2\xff\xfe",
    "a reserved byte": b"\xc1",
    "two keys of nil": b"\x82\xc0\x00\xc0\x00",
    "two messages": b"\x93\x01\x00\x90" * 2,
}


@pytest.mark.parametrize("data", BOMBS.values(), ids=BOMBS)
def test_a_bomb_is_refused(data):
    for reader, _ in READERS:
        with pytest.raises(WireError):
            reader(data)


@pytest.mark.parametrize(
    ("reader", "limit_b"),
    [
        (unpack_transmission, MAX_TRANSMISSION_B),
        (unpack_batch, MAX_BATCH_B),
        (unpack_delivery, MAX_DELIVERY_B),
    ],
)
def test_a_message_that_is_too_long_is_not_decoded(reader, limit_b, monkeypatch):
    monkeypatch.setattr(msgpack, "unpackb", lambda *_, **__: pytest.fail("it was decoded"))
    with pytest.raises(WireError, match="oversize"):
        reader(bytes(limit_b + 1))


def test_messages_cannot_be_changed():
    with pytest.raises(AttributeError):
        Transmission(1, 0, ()).slot = 2
    assert msgspec.structs.replace(Transmission(1, 0, ()), slot=2) == Transmission(2, 0, ())
