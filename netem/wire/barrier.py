"""Taking turns: in lockstep nobody goes on before the others have answered.

Waits are counted, not timed: a host that stands still for a minute has not waited for a minute,
and nobody waits for ever.
"""

from collections.abc import Callable

from netem.wire.bus import Ring

ANSWER_WITHIN_S = 20.0
LOOK_EVERY_S = 0.2
TURN_RING = 4
"""Room for the messages of one key, of which a turn has one."""


class LockstepError(RuntimeError):
    """Somebody did not answer, or answered for another slot; the text says who, and to what."""


class UnwantedError(Exception):
    """The run is over while an answer is waited for."""


def answer(
    ring: Ring, what: str, unwanted: Callable[[], bool], within_s: float = ANSWER_WITHIN_S
) -> bytes:
    """Return the next message on a ring.

    ``unwanted`` is asked now and then. Raises UnwantedError when it says so, and LockstepError,
    with ``what`` is missing, when the message has not come after ``within_s`` [s].
    """
    waited_s = 0.0
    while waited_s < within_s:
        data = ring.wait(LOOK_EVERY_S)
        if data is not None:
            return data
        if unwanted():
            raise UnwantedError
        waited_s += LOOK_EVERY_S
    raise LockstepError(f"{what} has not come within {within_s:g} s")


def same_slot(what: str, told: int, slot: int) -> None:
    """Raise LockstepError where a message is of another slot than the one that is played."""
    if told != slot:
        raise LockstepError(f"{what} is of slot {told}, in slot {slot}")
