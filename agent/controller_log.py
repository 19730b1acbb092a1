"""A controller's log: lines that it writes as it decides, into its agent's log and the recording.

A controller that derives from Logging has ``self.log(...)``. It works without a fleet too: the
lines are in ``take_log()``.
"""

from typing import Final

from agent.messages import MAX_LOG_CHARACTERS, MAX_LOG_LINES

LINES_PER_S: Final = 10
"""A controller writes so many lines in a second of simulated time; more are left out, and
counted."""


class Logging:
    """Base of a controller that writes a log; it needs no call of ``super().__init__``."""

    _log_lines: list[str]

    def log(self, *values: object) -> None:
        """Write one line: the values, with spaces between them, as print() does."""
        if "_log_lines" not in self.__dict__:
            self._log_lines = []
        if len(self._log_lines) <= LINES_PER_S:  # the limiter counts no more of one tick
            self._log_lines.append(" ".join(map(str, values))[:MAX_LOG_CHARACTERS])

    def take_log(self) -> list[str]:
        """Return the lines written since the last call."""
        lines: list[str] = self.__dict__.get("_log_lines", [])
        self._log_lines = []
        return lines


class LogLimiter:
    """Lets through so many lines in a second, a few each tick, and says how many it left out."""

    def __init__(self) -> None:
        self._second = -1
        self._let, self._left_out = 0, 0
        self._waiting: list[str] = []

    def limited(self, lines: list[str], now_s: float) -> tuple[str, ...]:
        """Return the lines to tell at a tick, of those that waited and of new ones."""
        if int(now_s) != self._second:
            self._begin_second(int(now_s))
        for line in lines:
            if self._let < LINES_PER_S:
                self._let += 1
                self._waiting.append(_one_line(line))
            else:
                self._left_out += 1
        told, self._waiting = self._waiting[:MAX_LOG_LINES], self._waiting[MAX_LOG_LINES:]
        return tuple(told)

    def _begin_second(self, second: int) -> None:
        self._second, self._let = second, 0
        if self._left_out:
            self._waiting.append(f"({self._left_out} lines left out: {LINES_PER_S} a second)")
            self._left_out = 0


def _one_line(text: str) -> str:
    """Return a text in one line that any file can hold."""
    line = " ".join(str(text).splitlines())[:MAX_LOG_CHARACTERS]
    return line.encode("utf-8", "replace").decode("utf-8")
