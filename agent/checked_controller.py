"""A controller whose intents are checked and whose failures name the controller and the agent."""

import signal
import traceback
from collections.abc import Iterable, Mapping
from math import inf, isfinite
from operator import index
from re import fullmatch
from typing import Final

from msgspec.structs import replace

from agent.child import ProgramError
from agent.config import AgentSetup
from agent.controller import (
    Controller,
    Decide,
    FailedProgramError,
    FaultyControllerError,
    Intent,
    Outgoing,
    Senses,
    Words,
    load,
)
from agent.controller_log import Logging, LogLimiter
from agent.messages import (
    MAX_ANGLE_RAD,
    MAX_DATAGRAM_B,
    MAX_FORCE,
    MAX_M,
    MAX_SIGNAL,
    MAX_SIGNALS,
    MAX_SPEED_MPS,
    SIGNAL_NAME,
    Place,
    Vector,
)
from agent.parameters import made
from netem.compiled import UnloadableError
from netem.wire.channels import CHANNELS

MAX_INDEX: Final = 2**15
"""Queues and ranks are below it, and at least -1, as on the wire."""
NUMBERS: Final = 13
"""Numbers in an intent besides its target: three vectors, two tilt angles, yaw and force."""
SMALL = min(MAX_SPEED_MPS, MAX_ANGLE_RAD)
"""Numbers whose absolute values add up to no more than this are within every bound."""

MESSAGE_FIELDS: Final = 2
MAX_DATAGRAMS: Final = 8
"""Most datagrams that a controller sends in one tick."""

MAX_ERROR_TEXT: Final = 2000
"""Characters of an error's text that are kept."""


class CheckedController:
    """One agent's controller. Raises ControllerError if it cannot be loaded.

    Any error of the controller's constructor or ``decide`` is raised as FaultyControllerError,
    SystemExit and KeyboardInterrupt included; Ctrl-C passes, and so does compiled code that cannot
    be loaded. decide: how it is asked; None: directly.
    """

    def __init__(self, setup: AgentSetup, decide: Decide | None = None) -> None:
        control = setup.control
        name = control.command[0] if control.command else control.controller
        self._label = f"controller {name!r} of agent {setup.id}"
        controller_class = load(setup.control.controller)
        try:
            self._controller: Controller = made(controller_class, setup, setup.control.parameters)
        except ProgramError as error:
            raise self._program_fault("at its start", error) from None
        except BaseException as error:
            raise self._fault("in its constructor", error) from error
        self._decide = decide
        self._stated: set[str] = set()
        """The names of the signals so far."""
        logs = isinstance(self._controller, Logging)
        self._limiter = LogLimiter() if logs else None

    def decide(self, senses: Senses) -> Intent:
        """Return the controller's intent, in plain floats within the bounds of a command."""
        try:
            if self._decide is not None:
                intent = plain(self._decide(self._controller, senses))
            else:
                intent = plain(self._controller.decide(senses))
            if intent.signals:
                self._note_signals(intent.signals)
        except ProgramError as error:
            raise self._program_fault(f"at {senses.now_s:g} s", error) from None
        except BaseException as error:
            raise self._fault(f"at {senses.now_s:g} s", error) from error
        return intent

    def _note_signals(self, signals: Mapping[str, float]) -> None:
        """Raise ValueError where the controller has stated too many different signals."""
        self._stated.update(signals)
        if len(self._stated) > MAX_SIGNALS:
            named = ", ".join(sorted(self._stated)[:MAX_SIGNALS])
            detail = f"{len(self._stated)} different signals so far, {named} ..."
            raise ValueError(f"{detail}; at most {MAX_SIGNALS} are allowed in all")

    def log(self, now_s: float) -> tuple[str, ...]:
        """Return the lines that the controller has written, no more than may be told now."""
        if self._limiter is None:
            return ()
        return self._limiter.limited(self._controller.take_log(), now_s)  # type: ignore[attr-defined]

    def _program_fault(self, when: str, error: ProgramError) -> FailedProgramError:
        return FailedProgramError(f"{self._label} failed {when}: {error}")

    def _fault(self, when: str, error: BaseException) -> FaultyControllerError:
        """Return the error that names the controller; re-raise one that is not its own."""
        if isinstance(error, UnloadableError):
            raise error
        if isinstance(error, KeyboardInterrupt) and _ctrl_c_raises():
            raise error
        if isinstance(error, MemoryError):
            traceback.clear_frames(error.__traceback__)
        return FaultyControllerError(f"{self._label} failed {when}: {described(error)}")


def _ctrl_c_raises() -> bool:
    """Return whether a KeyboardInterrupt can come from the keyboard."""
    return signal.getsignal(signal.SIGINT) is signal.default_int_handler


def described(error: BaseException) -> str:
    """Return the type and text of any error in one line, also where its own ``__str__`` fails."""
    try:
        text = " ".join(str(error)[:MAX_ERROR_TEXT].splitlines())
    except Exception as own:
        text = f"its text cannot be shown: {type(own).__name__} in its __str__"
    return f"{type(error).__name__}: {text}" if text else type(error).__name__


def plain(intent: Intent) -> Intent:
    """Return an intent in plain floats; numpy's numbers are converted.

    Raises TypeError if it is not an Intent, ValueError for numbers outside a command's bounds.
    """
    # isinstance() alone is slow for structures of msgspec.
    if type(intent) is not Intent and not isinstance(intent, Intent):
        raise TypeError(f"decide returned {type(intent).__name__}, not an Intent")
    if intent.messages or intent.signals:
        intent = replace(
            intent, messages=_messages(intent.messages), signals=_signals(intent.signals)
        )
    if not _claims_soundly(intent):
        intent = _with_sound_claims(intent)
    numbers = (
        *intent.wanted,
        *intent.velocity,
        *intent.heading_for,
        *intent.tilt,
        intent.yaw,
        intent.force,
    )
    target = () if intent.target is None else intent.target
    total = sum(map(abs, (*numbers, *target)))
    # The fast path, nearly always taken: one sum shows that all are plain, finite and small.
    sound = type(total) is float and total <= SMALL and intent.force >= 0.0
    tuples = type(intent.wanted) is type(intent.velocity) is type(intent.heading_for) is tuple
    return intent if sound and tuples and len(numbers) == NUMBERS else _converted(intent)


def _claims_soundly(intent: Intent) -> bool:
    """Return whether an intent's claim is of the right types and bounds."""
    place = intent.place
    placed = place is None or (
        type(place) is Place and -1 <= place.queue < MAX_INDEX and -1 <= place.rank < MAX_INDEX
    )
    return placed and 0.0 <= intent.cost_m < inf and type(intent.words) is Words


def _with_sound_claims(intent: Intent) -> Intent:
    """Return an intent with its claim in the right types. Raises ValueError or TypeError."""
    if not isinstance(intent.words, Words):
        raise TypeError(f"the Intent's words are {type(intent.words).__name__}, no Words")
    cost_m = float(intent.cost_m)
    if not 0.0 <= cost_m < inf:
        raise ValueError(f"the Intent's cost_m is {cost_m:g}; it is a distance, at least 0")
    place = None if intent.place is None else _place(intent.place)
    return replace(intent, cost_m=cost_m, place=place, words=Words(*intent.words))


def _place(given: Iterable[int]) -> Place:
    try:
        queue, rank = (index(each) for each in given)
    except (TypeError, ValueError) as error:
        raise ValueError(f"the Intent's place is {given!r:.80}, no queue and rank") from error
    if not (-1 <= queue < MAX_INDEX and -1 <= rank < MAX_INDEX):
        raise ValueError(f"the Intent's place is {given!r:.80}; at most {MAX_INDEX - 1} each")
    return Place(queue, rank)


def _converted(intent: Intent) -> Intent:
    if intent.force < 0.0:
        raise ValueError(f"the Intent's force is {intent.force:g}; it is a magnitude, at least 0")
    pitch, roll = _numbers("tilt", intent.tilt, 2, MAX_ANGLE_RAD)
    return replace(
        intent,
        wanted=_vector("wanted", intent.wanted, MAX_SPEED_MPS),
        velocity=_vector("velocity", intent.velocity, MAX_SPEED_MPS),
        yaw=_numbers("yaw", (intent.yaw,), 1, MAX_ANGLE_RAD)[0],
        force=_numbers("force", (intent.force,), 1, MAX_FORCE)[0],
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
        plain_data = bytes(data)  # a memoryview counts items, which may be longer
        if len(plain_data) > MAX_DATAGRAM_B:
            detail = f"{len(plain_data)} B; at most {MAX_DATAGRAM_B} B are allowed"
            raise ValueError(f"a message has {detail}")
        if len(messages) == MAX_DATAGRAMS:
            raise ValueError(f"more than {MAX_DATAGRAMS} messages in one tick")
        messages.append(Outgoing(CHANNELS[CHANNELS.index(channel)], plain_data))
    return tuple(messages)


def _signals(given: Mapping[str, float]) -> dict[str, float]:
    """Return an intent's signals as plain floats by name."""
    if not isinstance(given, Mapping):
        raise TypeError(f"the Intent's signals are {type(given).__name__}, no mapping of names")
    if len(given) > MAX_SIGNALS:
        raise ValueError(f"{len(given)} signals; at most {MAX_SIGNALS} are allowed")
    signals = {}
    for name, value in given.items():
        if not isinstance(name, str) or fullmatch(SIGNAL_NAME, name) is None:
            detail = "lower-case letters, digits and _, at most 32, a letter first"
            raise ValueError(f"{name!r} is no name of a signal: {detail}")
        signals[str.__str__(name)] = _signal(name, value)
    return signals


def _signal(name: str, value: object) -> float:
    if isinstance(value, str | bytes):
        raise TypeError(f"the signal {name!r} is {value!r:.40}, no number")
    try:
        number = float(value)  # type: ignore[arg-type]
    except (TypeError, ValueError, OverflowError) as error:
        raise ValueError(f"the signal {name!r} is no number: {error}") from error
    if not isfinite(number) or abs(number) > MAX_SIGNAL:
        raise ValueError(f"the signal {name!r} is {number:g}; at most {MAX_SIGNAL:g}")
    return number


def _vector(name: str, given: Iterable[float], bound: float) -> Vector:
    x, y, z = _numbers(name, given, 3, bound)
    return (x, y, z)


def _numbers(name: str, given: Iterable[float], count: int, bound: float) -> list[float]:
    numbers = [float(each) for each in given]
    if len(numbers) != count:
        raise ValueError(f"the Intent's {name} has {len(numbers)} numbers instead of {count}")
    for number in numbers:
        if not isfinite(number) or abs(number) > bound:
            raise ValueError(f"the Intent's {name} holds {number:g}; at most {bound:g} is allowed")
    return numbers
