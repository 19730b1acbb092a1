"""A saboteur: what it sends by the radios of its victims.

It overhears every frame that agents send, and knows what anybody can find out of a payload: an
array in msgpack that begins with the sender's id, and a checksum. All that it draws belongs to a
fault, a victim and the number of a frame, so it sends the same whatever carries the frames.
"""

from collections import deque
from collections.abc import Callable, Iterator
from hashlib import blake2b
from math import inf, nan
from random import Random
from struct import Struct as Layout
from typing import Any, Final, NamedTuple, assert_never
from zlib import crc32

import msgspec

from netem.faults import Sabotage
from netem.wire.channels import LOCAL, MAX_PAYLOAD_B, MULTIHOP, NUMBERS, Channel
from netem.wire.frame import Transmission

CHECKSUM_B: Final = 4
MOST_KEPT: Final = 10_000
"""Frames of all victims that wait to be repeated; of more, the oldest are forgotten."""
AHEAD: Final = 1000
"""By so much a spoofed frame's sequence is higher than the true one."""
NESTED: Final = 500
SLACK_S: Final = 1e-9
"""Times closer than this are one time [s]."""
BAD_NUMBERS: Final = (nan, inf, -inf, 1e300)
_KEY: Final = Layout("<3q").pack


class Forged(NamedTuple):
    """A frame that the saboteur sends."""

    victim: int
    """Whose radio sends it."""
    incarnation: int
    """The victim's, as far as the saboteur knows."""
    channel: Channel
    payload: bytes


class Saboteur:
    """What one fault of sabotage sends. seed: 32 bytes; number: the fault's."""

    def __init__(self, seed: bytes, number: int, since_s: float, sabotage: Sabotage) -> None:
        self._seed, self._number, self._since_s = seed, number, since_s
        self._sabotage = sabotage
        self._sent = 0
        """Frames for each victim that were due so far."""
        self._incarnations = dict.fromkeys(sorted(sabotage.agents), 0)
        """Of each victim, as last overheard."""
        self._newest: dict[tuple[int, Channel], bytes] = {}
        """The newest payload of each agent on each channel."""
        self._to_repeat: deque[tuple[float, Forged]] = deque(maxlen=MOST_KEPT)
        """When each frame is due again [s], in this order."""

    def redraw(self, seed: bytes) -> None:
        """Draw what it sends from now on from another seed (32 bytes)."""
        self._seed = seed

    def overhear(self, source: int, sent_s: float, transmission: Transmission) -> None:
        """Take what an agent sends itself at a time [s]."""
        if source in self._incarnations:
            self._incarnations[source] = transmission.incarnation
        for channel, payload in ((each.channel, each.payload) for each in transmission.frames):
            self._newest[source, channel] = payload
            if self._sabotage.kind == "replay" and source in self._incarnations:
                again = Forged(source, transmission.incarnation, channel, payload)
                self._to_repeat.append((sent_s + self._sabotage.delay_s, again))

    def miss(self, now_s: float) -> None:
        """Forget the frames that are due by a time [s]: nobody sends them."""
        self._repeated(now_s)
        self._sent = self._number_by(now_s)

    def due(self, now_s: float) -> Iterator[Forged]:
        """Yield the frames that are due by a time [s], each once."""
        if self._sabotage.kind == "replay":
            yield from self._repeated(now_s)
            return
        first = self._sent
        self._sent = self._number_by(now_s)
        for number in range(first, self._sent):
            for victim in self._incarnations:
                forged = self._forged(victim, number)
                if forged is not None:
                    yield forged

    def _number_by(self, now_s: float) -> int:
        """Return how many frames of each victim are due by a time [s]."""
        return int((now_s - self._since_s) * self._sabotage.per_s + 1e-6)

    def _repeated(self, now_s: float) -> list[Forged]:
        """Return the frames to repeat by a time [s]; of one time, by victim."""
        due = []
        while self._to_repeat and self._to_repeat[0][0] <= now_s + SLACK_S:
            due.append(self._to_repeat.popleft())
        due.sort(key=lambda each: (each[0], each[1].victim))
        return [forged for _, forged in due]

    def _forged(self, victim: int, number: int) -> Forged | None:
        """Return a victim's frame of a number; None where nothing was overheard to make it of."""
        key = _KEY(self._number, victim, number)
        random = Random(int.from_bytes(blake2b(key, key=self._seed).digest(), "little"))
        channel = random.choice(NUMBERS)
        own = self._newest.get((victim, channel))
        match self._sabotage.kind:
            case "garbage":
                payload: bytes | None = garbage(own or b"", random)
            case "spoof":
                payload = self._spoofed(victim, channel, random)
            case "flood" | "replay":
                payload = own
            case _:
                assert_never(self._sabotage.kind)
        if payload is None:
            return None
        return Forged(victim, self._incarnations[victim], channel, payload)

    def _spoofed(self, victim: int, channel: Channel, random: Random) -> bytes | None:
        """Return another agent's newest frame, of a higher incarnation and sequence."""
        others = sorted(source for source, on in self._newest if on == channel and source != victim)
        return ahead(self._newest[random.choice(others), channel], channel) if others else None


def ahead(payload: bytes, channel: Channel) -> bytes:
    """Return a payload with a higher incarnation and sequence of its sender.

    A beacon has them after its id; a frame of the multihop channel has them in its first record.
    """
    frame = _fields(payload)
    if channel == LOCAL:
        said = frame
    elif channel == MULTIHOP:
        records = frame[2] if len(frame) > 2 else None
        said = records[0] if isinstance(records, list) and records else []
    else:
        assert_never(channel)
    if len(said) > 2 and all(type(each) is int for each in said[:3]):
        said[1] += 1
        said[2] += AHEAD
    return _payload(frame) or payload


def garbage(payload: bytes, random: Random) -> bytes:
    """Return what no agent may take: noise, or what is left of a payload of the victim's.

    Whatever has a valid checksum is no message, so nothing of it is a lie that could be believed.
    """
    return random.choice(KINDS)(payload, random)


def _noise(_: bytes, random: Random) -> bytes:
    return random.randbytes(random.choice((0, 3, 90, MAX_PAYLOAD_B)))


def _noise_with_checksum(_: bytes, random: Random) -> bytes:
    return _checked(b"\xc1" + random.randbytes(random.choice((0, 90, MAX_PAYLOAD_B - 5))))


def _cut(payload: bytes, random: Random) -> bytes:
    data = payload[:-CHECKSUM_B]
    return _checked(data[: random.randrange(len(data))] if data else b"")


def _longer(payload: bytes, random: Random) -> bytes:
    data = payload[:-CHECKSUM_B] + random.randbytes(random.randrange(1, 60))
    return _checked(data) if len(data) <= MAX_PAYLOAD_B - CHECKSUM_B else b""


def _mutated(payload: bytes, random: Random) -> bytes:
    """Flip bits of up to four bytes and keep the checksum: it finds all such errors."""
    mutated = bytearray(payload or bytes(CHECKSUM_B + 1))
    for place in random.sample(range(len(mutated)), min(4, len(mutated))):
        mutated[place] ^= random.randrange(1, 256)
    return bytes(mutated)


def _bad_number(payload: bytes, random: Random) -> bytes:
    frame = _fields(payload)
    places = list(_floats(frame))
    if not places:
        return _noise(payload, random)
    within, at = random.choice(places)
    within[at] = random.choice(BAD_NUMBERS)
    return _payload(frame)


def _nested(_: bytes, _random: Random) -> bytes:
    return _checked(b"\x91" * NESTED)


def _endless(payload: bytes, random: Random) -> bytes:
    """Announce more than a frame holds: an array, a map, bytes, a text or an extension."""
    head = random.choice((b"\xdd", b"\xdf", b"\xc6", b"\xdb", b"\xc9"))
    return _checked(head + b"\xff\xff\xff\xff" + payload[:90])


KINDS: Final[tuple[Callable[[bytes, Random], bytes], ...]] = (
    _noise,
    _noise_with_checksum,
    _cut,
    _longer,
    _mutated,
    _bad_number,
    _nested,
    _endless,
)


def _checked(data: bytes) -> bytes:
    return data + crc32(data).to_bytes(CHECKSUM_B, "little")


def _payload(fields: list[Any]) -> bytes:
    """Return the payload of a frame's fields; empty without any, or too long for the radio."""
    payload = _checked(msgspec.msgpack.encode(fields))
    return payload if fields and len(payload) <= MAX_PAYLOAD_B else b""


def _fields(payload: bytes) -> list[Any]:
    """Return the fields of a payload; none where it is no array."""
    try:
        found = msgspec.msgpack.decode(payload[:-CHECKSUM_B])
    except (msgspec.DecodeError, UnicodeDecodeError, RecursionError):
        return []
    return found if isinstance(found, list) else []


def _floats(fields: list[Any]) -> Iterator[tuple[list[Any], int]]:
    """Yield where the floats are: the list around each, and its place in it."""
    for at, each in enumerate(fields):
        if isinstance(each, float):
            yield fields, at
        elif isinstance(each, list):
            yield from _floats(each)
