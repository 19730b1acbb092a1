"""Ctrl-C and SIGTERM as a question that runs ask, so that they end between slots and tell."""

import signal
from collections.abc import Iterator
from contextlib import contextmanager

from netem.wire.stop import Stop

SIGNALS = (signal.SIGINT, signal.SIGTERM)


@contextmanager
def stoppable() -> Iterator[Stop]:
    """Give a :class:`Stop` that holds within this block; what was asked before holds after it."""
    before = {number: signal.getsignal(number) for number in SIGNALS}
    try:
        yield Stop()
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
