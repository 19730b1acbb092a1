"""A progress line for work that takes over two seconds."""

import sys
from time import monotonic
from typing import TextIO

from worldsim.results.output_streams import Unescaped, escaped

QUIET_S = 2.0
"""Shorter work shows no progress."""
LINE_EVERY_S = 0.2
LOG_EVERY_S = 5.0


def pace_text(time_s: float, duration_s: float, factor: float | None) -> str:
    """Return how far a run is, such as "12.0 of 20 s, 2 s left, 4.01 x real time".

    time_s, duration_s: so far, and in all [s; simulated time]; factor: simulated seconds in a
    second of wall time, None where it is not known yet. What is left is wall time.
    """
    done = f"{time_s:.1f} of {duration_s:g} s"
    if not factor:
        return done
    return f"{done}, {(duration_s - time_s) / factor:.0f} s left, {factor:.3g} x real time"


class ProgressLine:
    """A line that is updated in place on a terminal, and printed now and then elsewhere.

    hidden: nothing is shown at all.
    """

    def __init__(self, stream: TextIO | None = None, *, hidden: bool = False) -> None:
        self._hidden = hidden
        self._stream = stream if stream is not None else sys.stderr
        self._controls = Unescaped(self._stream)
        self._next_s = monotonic() + QUIET_S
        self._shown = False

    def update(self, text: str) -> None:
        """Show how far the work is, unless it was shown a moment ago."""
        if self._hidden or monotonic() < self._next_s:
            return
        terminal = self._stream.isatty()
        self._next_s = monotonic() + (LINE_EVERY_S if terminal else LOG_EVERY_S)
        self._controls.write(f"\r\x1b[K{escaped(text)}" if terminal else f"{escaped(text)}\n")
        self._stream.flush()
        self._shown = terminal

    def clear(self) -> None:
        """Remove the line from the terminal."""
        if self._shown:
            self._controls.write("\r\x1b[K")
            self._stream.flush()
