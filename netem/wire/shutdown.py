"""How a process ends: on a signal, or when the world says that the run is over.

Ctrl-C, SIGTERM and SIGHUP (the terminal closes) ask a run to end and to write its results. A
process that is asked finishes what it is doing: its loops poll a :class:`StopRequest` or a
:class:`RunEnd`.
"""

import signal
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from netem.wire.bus import Subscriber

RUN_OVER = b"the run is over"
"""The message that the run has ended; any other one on its topic ends nothing."""
SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


class StopRequest:
    """Whether a signal has asked this process to end.

    SIGTERM does. SIGINT and SIGHUP do unless they are ignored: then a launcher controls the end, or
    nohup keeps the process.
    """

    def __init__(self) -> None:
        self.requested = False
        for number in SIGNALS:
            if number == signal.SIGTERM or signal.getsignal(number) is not signal.SIG_IGN:
                signal.signal(number, self._request)

    def _request(self, _number: int, _frame: FrameType | None) -> None:
        self.requested = True


class RunEnd:
    """Whether the run is over for this process: a stop was requested, or the world says so.

    over: subscriber to the topic of that name.
    """

    def __init__(self, over: "Subscriber", stop: StopRequest) -> None:
        self._received = False
        self._over = over
        self._stop = stop

    def __call__(self) -> bool:
        """Poll, and return whether the run is over."""
        self._received = self._received or RUN_OVER in self._over.drain(1)
        return self._received or self._stop.requested


def interrupt_on_signals() -> None:
    """Let SIGTERM raise KeyboardInterrupt as Ctrl-C does, and SIGHUP unless it is ignored."""
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    if signal.getsignal(signal.SIGHUP) is not signal.SIG_IGN:
        signal.signal(signal.SIGHUP, signal.default_int_handler)


def ignore_signals() -> None:
    """Ignore every signal that ends a run: a second Ctrl-C would leave the end half done."""
    for number in SIGNALS:
        signal.signal(number, signal.SIG_IGN)


@contextmanager
def stop_requests() -> Iterator[StopRequest]:
    """Yield a :class:`StopRequest` for this block; restore the earlier handlers after it."""
    before = {number: signal.getsignal(number) for number in SIGNALS}
    try:
        yield StopRequest()
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
