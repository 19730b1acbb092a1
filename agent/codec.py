"""Encoding and decoding of messages, with every check that needs no state."""

from collections.abc import Callable
from typing import Any, Final, TypeVar, final
from zlib import crc32

import msgpack
import msgspec

from agent.heard_beacon import HeardBeacon
from agent.messages import (
    MAX_PIECES,
    PIECE_B,
    Beacon,
    Command,
    Datagram,
    Gossip,
    Observation,
    Summary,
)
from agent.qstructure.expression import MAX_EXPRESSION_LENGTH
from agent.qstructure.formation import FormationSpec
from agent.rejection import RejectedError
from netem.wire.channels import MAX_PAYLOAD_B

CHECKSUM_B: Final = 4
MAX_MESSAGE_B: Final = 4096
MAX_COMMAND_B: Final = 8192
"""A command, with the telemetry of an agent that has much to tell."""
DATAGRAM_MARK: Final = 0x92
"""First byte of a frame that holds a datagram: msgpack's mark of an array of two fields."""
CHECKED_EVERY: Final = 61
"""A prime, so that the turn of each agent and of each kind of message comes."""
MAX_OBSERVATION_B: Final = 65536
"""Sensed vehicles, scans, and with them a mission: its formation and its frame's path."""

_T = TypeVar("_T", bound=msgspec.Struct)
_encode: Final = msgspec.msgpack.Encoder().encode
_GOSSIP: Final = Gossip
_SUMMARY: Final = Summary


def encode(message: msgspec.Struct) -> bytes:
    """Encode any message as msgpack; a summary that says nothing of lines, without that field."""
    data = _encode(message)
    # isinstance() is slow for structures of msgspec; neither of these has subclasses.
    kind = type(message)
    summary: Summary | None = None
    if kind is _GOSSIP:
        summary = message.summary  # type: ignore[attr-defined]
    elif kind is _SUMMARY:
        summary = message  # type: ignore[assignment]
    if summary is not None and summary.lines is None:
        return _without_last_field(data, len(_encode(summary)))
    return data


def _without_last_field(data: bytes, array_b: int) -> bytes:
    """Return data that ends with an array of some bytes, without the array's last field, a nil."""
    head = len(data) - array_b
    return data[:head] + bytes([data[head] - 1]) + data[head + 1 : -1]


def add_checksum(data: bytes) -> bytes:
    """Return a radio payload: the data, followed by its crc32."""
    return data + crc32(data).to_bytes(CHECKSUM_B, "little")


def strip_checksum(payload: bytes) -> bytes:
    """Return a radio payload's data; raise :class:`RejectedError` if its checksum is wrong."""
    if len(payload) > MAX_PAYLOAD_B:
        raise RejectedError("oversize", f"{len(payload)} B where {MAX_PAYLOAD_B} B are allowed")
    data = payload[:-CHECKSUM_B]
    if payload != add_checksum(data):
        raise RejectedError("corrupt", "the checksum does not match")
    return data


def decode(data: bytes, kind: type[_T], max_bytes: int = MAX_MESSAGE_B, max_text: int = 64) -> _T:
    """Decode and check one message, or raise :class:`RejectedError`.

    The limits assume a hostile radio: no extension types, short arrays and strings, every number
    finite and in its range, and exactly the fields of the message.
    """
    if len(data) > max_bytes:
        raise RejectedError("oversize", f"{len(data)} B where {max_bytes} B are allowed")
    try:
        plain: Any = msgpack.unpackb(  # type: ignore[attr-defined, no-untyped-call]
            data,
            strict_map_key=True,
            raw=False,
            use_list=False,
            max_array_len=256,
            max_map_len=64,
            max_str_len=max_text,
            max_bin_len=4096,
            max_ext_len=0,
        )
    except (ValueError, TypeError, RecursionError, msgpack.exceptions.UnpackException) as error:
        raise RejectedError("garbage", str(error)) from error
    try:
        return msgspec.convert(plain, kind, builtin_types=(bytes,))
    except (msgspec.ValidationError, RecursionError) as error:
        raise RejectedError("invalid", f"{kind.__name__}: {error}") from error


def encode_formation(formation: FormationSpec) -> bytes:
    """Encode a formation's tables as msgpack."""
    return _encode(formation)


def decode_formation(data: bytes) -> FormationSpec:
    """Decode a formation received over the radio, or raise :class:`RejectedError`."""
    return decode(data, FormationSpec, MAX_PIECES * PIECE_B, max_text=MAX_EXPRESSION_LENGTH)


_beacon: Final = msgspec.msgpack.Decoder(Beacon).decode
_gossip: Final = msgspec.msgpack.Decoder(Gossip).decode
_datagram: Final = msgspec.msgpack.Decoder(Datagram).decode
_observation: Final = msgspec.msgpack.Decoder(Observation).decode
_command: Final = msgspec.msgpack.Decoder(Command).decode


def decode_beacon(payload: bytes) -> Beacon:
    """Decode a payload of the local channel, or raise :class:`RejectedError`."""
    return _typed(strip_checksum(payload), _beacon, MAX_PAYLOAD_B)


def hear_beacon(payload: bytes) -> HeardBeacon:
    """Decode a payload of the local channel for its receivers, or raise :class:`RejectedError`."""
    return HeardBeacon(decode_beacon(payload))


def decode_gossip(payload: bytes) -> Gossip:
    """Decode a payload of the multihop channel, or raise :class:`RejectedError`."""
    return _typed(strip_checksum(payload), _gossip, MAX_PAYLOAD_B)


def holds_datagram(payload: bytes) -> bool:
    """Return whether a payload, of either channel, holds a controller's datagram."""
    return len(payload) > 0 and payload[0] == DATAGRAM_MARK


def decode_datagram(payload: bytes) -> Datagram:
    """Decode a controller's datagram, or raise :class:`RejectedError`."""
    return _typed(strip_checksum(payload), _datagram, MAX_PAYLOAD_B)


def decode_observation(data: bytes) -> Observation:
    """Decode the world's message to an agent, or raise :class:`RejectedError`."""
    return _typed(data, _observation, MAX_OBSERVATION_B)


def decode_command(data: bytes) -> Command:
    """Decode an agent's message to the world, or raise :class:`RejectedError`."""
    return _typed(data, _command, MAX_COMMAND_B)


@final
class RadioCodec:
    """Encodes and decodes radio payloads, each once for all agents that a process feeds.

    kept: at least the newest so many payloads of a channel are known with what they hold; decoding
    is a pure function of the bytes. What was encoded here is known, too: it is handed over. One
    message in ``CHECKED_EVERY`` is decoded nevertheless, and must come out equal.
    """

    def __init__(self, kept: int = 0) -> None:
        self._most = kept
        self._encoded = 0
        self._beacons: dict[bytes, HeardBeacon] = {}
        self._gossip: dict[bytes, Gossip] = {}

    def encode_beacon(self, beacon: Beacon) -> bytes:
        """Return a beacon's payload."""
        payload = add_checksum(encode(beacon))
        if self._most:
            if self._is_checked():
                check_equal(beacon, decode_beacon(payload))
            self._make_room(self._beacons)
            self._beacons[payload] = HeardBeacon(beacon)
        return payload

    def encode_gossip(self, gossip: Gossip) -> bytes:
        """Return the payload of a frame of the multihop channel."""
        payload = add_checksum(encode(gossip))
        if self._most:
            if self._is_checked():
                check_equal(gossip, decode_gossip(payload))
            self._make_room(self._gossip)
            self._gossip[payload] = gossip
        return payload

    def beacon(self, payload: bytes) -> HeardBeacon:
        """Decode a payload of the local channel, or raise :class:`RejectedError`."""
        if not self._most:
            return hear_beacon(payload)
        found = self._beacons.get(payload)
        if found is None:
            found = hear_beacon(payload)
            self._make_room(self._beacons)
            self._beacons[payload] = found
        return found

    def gossip(self, payload: bytes) -> Gossip:
        """Decode a payload of the multihop channel, or raise :class:`RejectedError`."""
        if not self._most:
            return decode_gossip(payload)
        found = self._gossip.get(payload)
        if found is None:
            found = decode_gossip(payload)
            self._make_room(self._gossip)
            self._gossip[payload] = found
        return found

    def _is_checked(self) -> bool:
        """Whether the next message that is encoded is decoded, too."""
        self._encoded += 1
        return self._encoded % CHECKED_EVERY == 0

    def _make_room(self, known: dict[bytes, Any]) -> None:
        """Forget the older half of what is known where that is twice as much as is kept."""
        if len(known) >= 2 * self._most:
            for payload in list(known)[: self._most]:
                del known[payload]


def check_equal(sent: _T, arrived: _T) -> None:
    """Raise ValueError if a message does not come out of the codec as it went in."""
    if arrived != sent:
        raise ValueError(f"the codec makes {arrived!r} of {sent!r}")


def _typed(data: bytes, decode_typed: Callable[[bytes], _T], max_bytes: int) -> _T:
    """Decode arrays of fixed shape: the type alone bounds depth, lengths and extension types."""
    if len(data) > max_bytes:
        raise RejectedError("oversize", f"{len(data)} B where {max_bytes} B are allowed")
    try:
        return decode_typed(data)
    except msgspec.ValidationError as error:
        raise RejectedError("invalid", str(error)) from error
    except (msgspec.DecodeError, UnicodeDecodeError) as error:
        raise RejectedError("garbage", str(error)) from error
