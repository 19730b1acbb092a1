"""Intents of plain numbers: what a controller returns is converted once, and then checked.

Compiled code would convert values where they are read, and refuse others in words of its own; so
this is pure Python.
"""

from collections.abc import Iterable, Mapping
from math import inf, isfinite
from operator import index
from re import fullmatch
from typing import Annotated, Final, NamedTuple

import msgspec
from msgspec import Meta
from msgspec.structs import replace

from agent.controller import NO_SIGNALS, NO_WORDS, Intent, Outgoing, Words
from agent.messages import (
    MAX_ANGLE_RAD,
    MAX_DATAGRAM_B,
    MAX_FORCE,
    MAX_M,
    MAX_PLACES,
    MAX_SIGNAL,
    MAX_SIGNALS,
    MAX_SPEED_MPS,
    ROLES,
    SIGNAL_NAME,
    Index,
    Members,
    ParentId,
    Place,
    Standing,
    Summary,
    Vector,
)
from agent.sound_intent import MAX_INDEX, claims_soundly, moves_soundly
from netem.wire.channels import CHANNELS

_TILTS: Final = 2  # pitch and roll
_EMPTY: Final = ()
MESSAGE_FIELDS: Final = 2
MAX_DATAGRAMS: Final = 8
"""Most datagrams that a controller sends in one tick."""


def plain(intent: Intent, trusts_words: bool = False) -> Intent:
    """Return an intent of plain floats, ints, strings, bytes and tuples; others are converted.

    A number of a class of its own (numpy's, or one with methods of its own) is converted once, and
    what is checked is what was converted: so what is checked is what is flown.

    trusts_words: whether the controller is one of this project's, whose words need no check.
    Raises TypeError if it is not an Intent, ValueError for numbers outside a command's bounds.
    """
    if type(intent) is not Intent:
        intent = _exact(intent)
    if intent.signals is not NO_SIGNALS or intent.messages is not _EMPTY:
        intent = replace(
            intent, messages=_messages(intent.messages), signals=_signals(intent.signals)
        )
    if intent.blocked is not _EMPTY:
        intent = replace(intent, blocked=_places(intent.blocked))
    if intent.words is not NO_WORDS and not (trusts_words and type(intent.words) is Words):
        intent = replace(intent, words=_words(intent.words))
    if not claims_soundly(intent):
        intent = _with_sound_claims(intent)
    return intent if moves_soundly(intent) else _converted(intent)


def _exact(given: object) -> Intent:
    """Return an Intent of a class derived from it as an Intent, each field read once."""
    if not isinstance(given, Intent):
        raise TypeError(f"decide returned {type(given).__name__}, not an Intent")
    return Intent(*[getattr(given, name) for name in Intent.__struct_fields__])


def _with_sound_claims(intent: Intent) -> Intent:
    """Return an intent with its claim in the right types. Raises ValueError or TypeError."""
    cost_m = _number("the Intent's cost_m", intent.cost_m)
    if not 0.0 <= cost_m < inf:
        raise ValueError(f"the Intent's cost_m is {cost_m:g}; it is a distance, at least 0")
    place = None if intent.place is None else _place(intent.place)
    return replace(intent, cost_m=cost_m, place=place, vertex=bool(intent.vertex))


def _place(given: Iterable[int]) -> Place:
    try:
        queue, rank = (index(each) for each in given)
    except (TypeError, ValueError) as error:
        raise ValueError(f"the Intent's place is {given!r:.80}, no queue and rank") from error
    if not (-1 <= queue < MAX_INDEX and -1 <= rank < MAX_INDEX):
        raise ValueError(f"the Intent's place is {given!r:.80}; at most {MAX_INDEX - 1} each")
    return Place(queue, rank)


def _places(given: Iterable[Iterable[int]]) -> tuple[Place, ...]:
    """Return the blocked places of an intent, no more than a beacon takes."""
    places: list[Place] = []
    for each in given:
        if len(places) == MAX_PLACES:
            raise ValueError(f"the Intent's blocked has more than {MAX_PLACES} places")
        places.append(_place(each))
    return tuple(places)


class _SoundWords(NamedTuple):
    """Words, with the bounds of the messages in which they go."""

    standing: Standing | None
    summary: Summary | None
    tier: Index
    parent: ParentId
    role: Annotated[int, Meta(ge=0, lt=len(ROLES))]
    agents: Members


_encode_words: Final = msgspec.msgpack.Encoder(enc_hook=index).encode
_decode_words: Final = msgspec.msgpack.Decoder(_SoundWords).decode


def _words(given: object) -> Words:
    """Return an intent's words as they are after a way over the wire: all of them plain."""
    if not isinstance(given, Words):
        raise TypeError(f"the Intent's words are {type(given).__name__}, no Words")
    try:
        return Words(*_decode_words(_encode_words(tuple(given))))
    except (msgspec.MsgspecError, TypeError, OverflowError) as error:
        raise ValueError(f"the Intent's words cannot be sent: {error}") from error


def _converted(intent: Intent) -> Intent:
    pitch, roll = _numbers("tilt", intent.tilt, _TILTS, MAX_ANGLE_RAD)
    force = _numbers("force", (intent.force,), 1, MAX_FORCE)[0]
    if force < 0.0:
        raise ValueError(f"the Intent's force is {force:g}; it is a magnitude, at least 0")
    return replace(
        intent,
        wanted=_vector("wanted", intent.wanted, MAX_SPEED_MPS),
        velocity=_vector("velocity", intent.velocity, MAX_SPEED_MPS),
        yaw=_numbers("yaw", (intent.yaw,), 1, MAX_ANGLE_RAD)[0],
        force=force,
        heading_for=_vector("heading_for", intent.heading_for, MAX_M),
        target=None if intent.target is None else _vector("target", intent.target, MAX_M),
        tilt=(pitch, roll),
    )


def _messages(given: Iterable[Outgoing]) -> tuple[Outgoing, ...]:
    """Return an intent's messages as bytes on a known channel; others' buffers are copied."""
    messages: list[Outgoing] = []
    for each in given:
        if not isinstance(each, tuple | list) or len(each) != MESSAGE_FIELDS:
            raise TypeError(f"{each!r:.80} among the Intent's messages is no Outgoing")
        channel, data = each
        if channel not in CHANNELS:
            raise ValueError(f"the channel {channel!r} of a message is none of {CHANNELS}")
        if not isinstance(data, bytes | bytearray | memoryview):
            raise TypeError(f"a message holds {type(data).__name__}, not bytes")
        # A memoryview may count items longer than a byte, and bytes() of a class derived from
        # bytes may be of that class.
        plain_data = memoryview(data).tobytes()
        if len(plain_data) > MAX_DATAGRAM_B:
            detail = f"{len(plain_data)} B; at most {MAX_DATAGRAM_B} B are allowed"
            raise ValueError(f"a message has {detail}")
        if len(messages) == MAX_DATAGRAMS:
            raise ValueError(f"more than {MAX_DATAGRAMS} messages in one tick")
        messages.append(Outgoing(CHANNELS[CHANNELS.index(channel)], plain_data))
    return tuple(messages)


def _signals(given: Mapping[str, float]) -> Mapping[str, float]:
    """Return an intent's signals as plain floats by name."""
    if not isinstance(given, Mapping):
        raise TypeError(f"the Intent's signals are {type(given).__name__}, no mapping of names")
    signals: dict[str, float] = {}
    for name, value in given.items():
        # Copied, for fullmatch() and str() are told by a class derived from str what it is.
        plain_name = str.__str__(name) if isinstance(name, str) else ""
        if fullmatch(SIGNAL_NAME, plain_name) is None:
            detail = "lower-case letters, digits and _, at most 32, a letter first"
            raise ValueError(f"{name!r} is no name of a signal: {detail}")
        signals[plain_name] = _signal(plain_name, value)
        if len(signals) > MAX_SIGNALS:
            raise ValueError(f"more than {MAX_SIGNALS} signals")
    return signals or NO_SIGNALS


def _signal(name: str, value: object) -> float:
    number = _number(f"the signal {name!r}", value)
    if not isfinite(number) or abs(number) > MAX_SIGNAL:
        raise ValueError(f"the signal {name!r} is {number:g}; at most {MAX_SIGNAL:g}")
    return number


def _number(what: str, value: object) -> float:
    """Return a number as a plain float. Raises TypeError or ValueError, which begin with what."""
    if isinstance(value, str | bytes):
        raise TypeError(f"{what} is {value!r:.40}, no number")
    try:
        return float(value)  # type: ignore[arg-type]
    except (TypeError, ValueError, OverflowError) as error:
        raise ValueError(f"{what} is no number: {error}") from error


def _vector(name: str, given: Iterable[float], bound: float) -> Vector:
    x, y, z = _numbers(name, given, 3, bound)
    return (x, y, z)


def _numbers(name: str, given: Iterable[float], count: int, bound: float) -> list[float]:
    numbers = [_number(f"the Intent's {name}", each) for each in given]
    if len(numbers) != count:
        raise ValueError(f"the Intent's {name} has {len(numbers)} numbers instead of {count}")
    for number in numbers:
        if not isfinite(number) or abs(number) > bound:
            raise ValueError(f"the Intent's {name} holds {number:g}; at most {bound:g} is allowed")
    return numbers
