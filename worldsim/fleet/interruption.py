"""Ctrl-C, SIGTERM and a terminal that goes away, as what a run is asked: to end, and to tell."""

import signal
from collections.abc import Iterator
from contextlib import contextmanager

from netem.wire.stop import Stop

SIGNALS = (signal.SIGINT, signal.SIGTERM)


def interruptible() -> None:
    """Let SIGTERM interrupt this process as Ctrl-C does, and SIGHUP unless it is ignored."""
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    if signal.getsignal(signal.SIGHUP) is not signal.SIG_IGN:
        signal.signal(signal.SIGHUP, signal.default_int_handler)


def uninterrupted() -> None:
    """Let nothing interrupt an end under way: a second Ctrl-C would leave it half done."""
    for number in (*SIGNALS, signal.SIGHUP):
        signal.signal(number, signal.SIG_IGN)


@contextmanager
def stoppable() -> Iterator[Stop]:
    """Give a :class:`Stop` that holds within this block; what was asked before holds after it."""
    before = {number: signal.getsignal(number) for number in SIGNALS}
    try:
        yield Stop()
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
