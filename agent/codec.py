"""Bytes to messages and back, with everything checked that can be checked without a state.

Decoding is a pure function of the bytes: :func:`decode_radio` may be memoised by whoever feeds
several agents in one process.
"""

from collections.abc import Callable
from typing import Any, TypeVar
from zlib import crc32

import msgpack
import msgspec

from agent.messages import MAX_PIECES, PIECE_B, Beacon, Command, Gossip, Observation
from agent.qstructure.expression import MAX_EXPRESSION_LENGTH
from agent.qstructure.formation import FormationSpec
from netem.wire.channels import MAX_PAYLOAD_B

SEAL_B = 4
MAX_MESSAGE_B = 4096
MAX_OBSERVATION_B = 65536
"""Bodies sensed, and with them a mission: its formation and its frame's path."""

_T = TypeVar("_T", bound=msgspec.Struct)
_encode = msgspec.msgpack.Encoder().encode


class RejectedError(ValueError):
    """A message that is refused; ``cause`` is the name it is counted under."""

    def __init__(self, cause: str, detail: str) -> None:
        super().__init__(f"{cause}: {detail}")
        self.cause = cause


def encode(message: msgspec.Struct) -> bytes:
    """Encode any message of ours as msgpack."""
    return _encode(message)


def sealed(data: bytes) -> bytes:
    """Return what the radio carries: bytes, and a checksum (crc32) after them."""
    return data + crc32(data).to_bytes(SEAL_B, "little")


def unsealed(payload: bytes) -> bytes:
    """Return what was sealed, or raise :class:`RejectedError` where a bit was turned on the way."""
    if len(payload) > MAX_PAYLOAD_B:
        raise RejectedError("oversize", f"{len(payload)} B where {MAX_PAYLOAD_B} B are allowed")
    data = payload[:-SEAL_B]
    if payload != sealed(data):
        raise RejectedError("corrupt", "the checksum does not fit")
    return data


def decode(data: bytes, kind: type[_T], max_bytes: int = MAX_MESSAGE_B, max_text: int = 64) -> _T:
    """Decode and check one message, or raise :class:`RejectedError`.

    The limits are those of a hostile radio: no extension types, short arrays and strings, every
    number finite and in its range, no field missing and none too many.
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
    """Decode a formation that came over the radio, or raise :class:`RejectedError`."""
    return decode(data, FormationSpec, MAX_PIECES * PIECE_B, max_text=MAX_EXPRESSION_LENGTH)


_beacon = msgspec.msgpack.Decoder(Beacon).decode
_gossip = msgspec.msgpack.Decoder(Gossip).decode
_observation = msgspec.msgpack.Decoder(Observation).decode
_command = msgspec.msgpack.Decoder(Command).decode


def decode_beacon(payload: bytes) -> Beacon:
    """Decode a frame of the local channel, or raise :class:`RejectedError`."""
    return _typed(unsealed(payload), _beacon, MAX_PAYLOAD_B)


def decode_gossip(payload: bytes) -> Gossip:
    """Decode a frame of the multihop channel, or raise :class:`RejectedError`."""
    return _typed(unsealed(payload), _gossip, MAX_PAYLOAD_B)


def decode_observation(data: bytes) -> Observation:
    """Decode what the world tells a vehicle, or raise :class:`RejectedError`."""
    return _typed(data, _observation, MAX_OBSERVATION_B)


def decode_command(data: bytes) -> Command:
    """Decode what an agent commands, or raise :class:`RejectedError`."""
    return _typed(data, _command, MAX_MESSAGE_B)


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
