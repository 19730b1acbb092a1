"""Frames, and the two messages that carry them between an agent and the medium.

An agent ends its slot with one :class:`Transmission` and starts it with one :class:`Batch`. The
payload of a frame is opaque: the radio never decodes it.
"""

from collections.abc import Callable
from typing import Annotated, Any, TypeVar

import msgpack
import msgspec
from msgspec import Meta

from netem.wire.channels import MAX_PAYLOAD_B, Channel

MAX_OUTGOING = 160
"""Greatest number of frames in a transmission."""
MAX_TRANSMISSION_B = MAX_OUTGOING * (MAX_PAYLOAD_B + 5) + 22
MAX_BATCH_B = 256 * 1024
BATCH_RING = 8
"""Number of batches that wait for an agent; newer ones replace the oldest."""
MAX_EARLY_US = 2**32 - 1
MAX_OBSERVATION_B = 64 * 1024
MAX_INBOX_B = BATCH_RING * (MAX_BATCH_B + 5) + MAX_OBSERVATION_B + 16
MAX_FRAMES = 4096
"""Greatest number of frames in a batch."""
FRAME_HEAD_B = 26
BATCH_HEAD_B = 13
"""Greatest size in msgpack of a frame without its payload, and of a batch without its frames."""
MAX_DELIVERY_B = MAX_BATCH_B + 5 * (MAX_FRAMES + 1)

Count = Annotated[int, Meta(ge=0, lt=2**53)]
AgentId = Annotated[int, Meta(ge=0, lt=2**16)]
Payload = Annotated[bytes, Meta(max_length=MAX_PAYLOAD_B)]
EncodedObservation = Annotated[bytes, Meta(max_length=MAX_OBSERVATION_B)]


class WireError(ValueError):
    """A message that is too long or malformed; the first word of the text is the cause."""


class Outgoing(msgspec.Struct, frozen=True, array_like=True, gc=False, forbid_unknown_fields=True):
    """A payload that an agent sends on one channel."""

    channel: Channel
    payload: Payload


class Transmission(
    msgspec.Struct, frozen=True, array_like=True, gc=False, forbid_unknown_fields=True
):
    """All frames that one agent sends in one slot; sent without frames too, to mark the slot."""

    slot: Count
    incarnation: Count
    frames: Annotated[tuple[Outgoing, ...], Meta(max_length=MAX_OUTGOING)]


class Frame(msgspec.Struct, frozen=True, array_like=True, gc=False, forbid_unknown_fields=True):
    """A received payload; count: the medium's own number of the frame."""

    source: AgentId
    incarnation: Count
    channel: Channel
    count: Count
    payload: Payload


class Batch(msgspec.Struct, frozen=True, array_like=True, gc=False, forbid_unknown_fields=True):
    """All frames that one agent receives at the start of one slot, in the order they fell due."""

    slot: Count
    frames: Annotated[tuple[Frame, ...], Meta(max_length=MAX_FRAMES)]


class Delivery(Batch, frozen=True, array_like=True, gc=False, forbid_unknown_fields=True):
    """A batch with the time at which each frame was due; for free-running."""

    early_us: Annotated[
        tuple[Annotated[int, Meta(ge=0, le=MAX_EARLY_US)], ...], Meta(max_length=MAX_FRAMES)
    ]
    """How long before the batch's slot each frame was due [us]."""


class Inbox(msgspec.Struct, frozen=True, array_like=True, gc=False, forbid_unknown_fields=True):
    """Everything that one agent needs for its step in a slot; for lockstep."""

    slot: Count
    observation: EncodedObservation
    """From the world; the medium passes it on unread."""
    batches: Annotated[tuple[bytes, ...], Meta(max_length=BATCH_RING)]
    """Encoded, oldest first: usually one; none at an agent's first step, several after a pause."""


_T = TypeVar("_T")
_encode = msgspec.msgpack.Encoder().encode


def pack(message: msgspec.Struct) -> bytes:
    """Encode a message as msgpack."""
    return _encode(message)


def unpack(data: bytes, kind: type[_T], max_bytes: int, max_items: int = MAX_FRAMES) -> _T:
    """Decode and check a message, or raise :class:`WireError`.

    Sizes are checked before any object is built. Extension types, map keys that are not strings,
    text in place of bytes, and numbers that are not finite or out of range are refused.
    """
    if len(data) > max_bytes:
        raise WireError(f"oversize: {len(data)} B where {max_bytes} B are allowed")
    try:
        plain: Any = msgpack.unpackb(  # type: ignore[attr-defined, no-untyped-call]
            data,
            strict_map_key=True,
            raw=False,
            use_list=False,
            max_array_len=max_items,
            max_map_len=64,
            max_str_len=64,
            max_bin_len=max_bytes,
            max_ext_len=0,
        )
        return msgspec.convert(plain, kind, builtin_types=(bytes,))
    except (ValueError, TypeError, RecursionError, msgpack.exceptions.UnpackException) as error:
        raise WireError(f"malformed {kind.__name__}: {error}") from error


_transmission = msgspec.msgpack.Decoder(Transmission).decode
_batch = msgspec.msgpack.Decoder(Batch).decode
_delivery = msgspec.msgpack.Decoder(Delivery).decode
_inbox = msgspec.msgpack.Decoder(Inbox).decode


def unpack_transmission(data: bytes) -> Transmission:
    """Decode an agent's transmission, or raise :class:`WireError`."""
    return unpack_typed(data, _transmission, MAX_TRANSMISSION_B)


def unpack_batch(data: bytes) -> Batch:
    """Decode a batch of the medium, or raise :class:`WireError`."""
    return unpack_typed(data, _batch, MAX_BATCH_B)


def unpack_delivery(data: bytes) -> Delivery:
    """Decode a delivery of the free-running medium, or raise :class:`WireError`."""
    delivery = unpack_typed(data, _delivery, MAX_DELIVERY_B)
    if len(delivery.early_us) != len(delivery.frames):
        raise WireError(
            f"malformed: {len(delivery.early_us)} due times for {len(delivery.frames)} frames"
        )
    return delivery


def unpack_inbox(data: bytes) -> Inbox:
    """Decode an agent's inbox, or raise :class:`WireError`."""
    return unpack_typed(data, _inbox, MAX_INBOX_B)


def unpack_typed(data: bytes, decode: Callable[[bytes], _T], max_bytes: int) -> _T:
    """Decode and check a message with a typed decoder, or raise :class:`WireError`.

    Faster than ``unpack``: the type alone bounds depth and lengths and refuses extension types.
    """
    if len(data) > max_bytes:
        raise WireError(f"oversize: {len(data)} B where {max_bytes} B are allowed")
    try:
        return decode(data)
    except (msgspec.MsgspecError, UnicodeDecodeError) as error:
        raise WireError(f"malformed: {error}") from error
