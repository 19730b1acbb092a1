"""How a process ends: by a signal, or because the world says that the run is over.

Ctrl-C, SIGTERM and a terminal that closes ask a run to end and to report. A process that was asked
finishes what it is doing; its loops look at a :class:`Stop`, or at an :class:`Ending`.
"""

import signal
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from netem.wire.bus import Ring

SIGNALS = (signal.SIGINT, signal.SIGTERM)


class Stop:
    """Whether this process was asked to end.

    SIGTERM asks it, and so does Ctrl-C unless SIGINT is ignored: then a launcher conducts the end.
    """

    def __init__(self) -> None:
        self.asked = False
        signal.signal(signal.SIGTERM, self._ask)
        if signal.getsignal(signal.SIGINT) is not signal.SIG_IGN:
            signal.signal(signal.SIGINT, self._ask)

    def _ask(self, _number: int, _frame: FrameType | None) -> None:
        self.asked = True


class Ending:
    """Whether the run is over for this process: it was asked to end, or the world says so.

    over: the ring of the topic on which the world says so.
    """

    def __init__(self, over: "Ring", stop: Stop) -> None:
        self._told = False
        self._over = over
        self._stop = stop

    def __call__(self) -> bool:
        """Look, and return whether it is."""
        self._told = self._told or bool(self._over.drain(1))
        return self._told or self._stop.asked


def interruptible() -> None:
    """Make SIGTERM interrupt this process as Ctrl-C does, and SIGHUP unless it is ignored."""
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    if signal.getsignal(signal.SIGHUP) is not signal.SIG_IGN:
        signal.signal(signal.SIGHUP, signal.default_int_handler)


def uninterrupted() -> None:
    """Ignore every signal that ends a run: a second Ctrl-C would leave the end half done."""
    for number in (*SIGNALS, signal.SIGHUP):
        signal.signal(number, signal.SIG_IGN)


@contextmanager
def stoppable() -> Iterator[Stop]:
    """Give a :class:`Stop` that holds within this block; earlier handlers return after it."""
    before = {number: signal.getsignal(number) for number in SIGNALS}
    try:
        yield Stop()
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
