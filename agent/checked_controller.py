"""A controller whose intents are checked and whose failures name the controller and the agent."""

import signal
import traceback
from collections.abc import Mapping
from typing import Any, Final

from agent.child import ProgramError
from agent.config import AgentSetup
from agent.controller import (
    BUILT_IN,
    Decide,
    FailedProgramError,
    FaultyControllerError,
    Intent,
    Senses,
    load,
)
from agent.controller_log import Logging, LogLimiter
from agent.messages import MAX_SIGNALS
from agent.parameters import made
from agent.plain_intent import plain
from agent.sound_intent import is_sound
from netem.compiled import UnloadableError

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
        self._trusts_words = control.controller in BUILT_IN
        self._label = f"controller {name!r} of agent {setup.id}"
        controller_class = load(setup.control.controller)
        try:
            self._controller: Any = made(controller_class, setup, setup.control.parameters)
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
            wanted = self._asked(senses)
            if is_sound(wanted, self._trusts_words):
                sound: Intent = wanted
                return sound
            intent = plain(wanted, self._trusts_words)
            if intent.signals:
                self._note_signals(intent.signals)
        except ProgramError as error:
            raise self._program_fault(f"at {senses.now_s:g} s", error) from None
        except BaseException as error:
            raise self._fault(f"at {senses.now_s:g} s", error) from error
        return intent

    def _asked(self, senses: Senses) -> Any:
        """Return what the controller returns, whatever that is."""
        ask: Any = self._decide
        return self._controller.decide(senses) if ask is None else ask(self._controller, senses)

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
        try:
            return self._limiter.limited(self._controller.take_log(), now_s)
        except BaseException as error:
            raise self._fault(f"at {now_s:g} s, in its log", error) from error

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
