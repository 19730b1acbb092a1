"""The lockstep barrier: no process goes on before the messages of its slot have arrived.

Waiting is counted in polls, not measured by a clock: a host that stands still for a minute has not
waited for a minute. Every wait has an end.
"""

from collections.abc import Callable

from netem.wire.bus import Subscriber

ANSWER_TIMEOUT_S = 20.0
POLL_S = 0.2
LOCKSTEP_RING = 4
"""Ring size of a lockstep subscriber, which receives one message a slot."""


class LockstepError(RuntimeError):
    """A message is missing or belongs to another slot; the text names it."""


class RunOverError(Exception):
    """The run has ended during a wait."""


def await_message(
    subscriber: Subscriber,
    what: str,
    is_over: Callable[[], bool],
    timeout_s: float = ANSWER_TIMEOUT_S,
) -> bytes:
    """Return the next message of a subscriber.

    what: the message's name for errors. is_over: polled while waiting. Raises RunOverError when it
    returns True, and LockstepError when no message has arrived after ``timeout_s`` [s].
    """
    waited_s = 0.0
    while waited_s < timeout_s:
        data = subscriber.wait(POLL_S)
        if data is not None:
            return data
        if is_over():
            raise RunOverError
        waited_s += POLL_S
    raise LockstepError(f"{what} has not arrived within {timeout_s:g} s")


def check_slot(what: str, received: int, expected: int) -> None:
    """Raise LockstepError where a message is not of the slot that is being played."""
    if received != expected:
        raise LockstepError(f"{what} is of slot {received}; expected slot {expected}")
