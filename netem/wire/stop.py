"""How a process is asked to end: by SIGTERM, or by Ctrl-C unless its launcher conducts the end."""

import signal
from types import FrameType


class Stop:
    """Whether this process was asked to end; its loops look, and finish what they are at."""

    def __init__(self) -> None:
        self.asked = False
        signal.signal(signal.SIGTERM, self._ask)
        if signal.getsignal(signal.SIGINT) is not signal.SIG_IGN:
            signal.signal(signal.SIGINT, self._ask)

    def _ask(self, _number: int, _frame: FrameType | None) -> None:
        self.asked = True
