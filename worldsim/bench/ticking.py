"""A call every second while other code of this thread runs: progress that costs no thread."""

import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager


@contextmanager
def ticking(show: Callable[[], None], every_s: float = 1.0) -> Iterator[None]:
    """Call ``show`` every ``every_s`` [s], in the main thread, until this block is left."""
    before = signal.signal(signal.SIGALRM, lambda *_: show())
    signal.setitimer(signal.ITIMER_REAL, every_s, every_s)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)
