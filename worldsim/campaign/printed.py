"""What the processes of a campaign print, passed on to stderr and bounded."""

import codecs
import os
import sys
from contextlib import suppress

MAX_PRINTED_B = 1024 * 1024
"""Of one run [B]."""
CHUNK_B = 64 * 1024


class PrintedOutput:
    """A pipe for the output of one run; ``pass_on`` copies it to stderr, up to MAX_PRINTED_B.

    A run's output is read to its end in any case: a writer never waits for long.
    """

    def __init__(self, run: str) -> None:
        self._run = run
        self._printed_b = self._dropped_b = 0
        self._decoder = codecs.getincrementaldecoder("utf-8")("backslashreplace")
        self._read_end, self.write_end = os.pipe()
        os.set_blocking(self._read_end, False)

    def fileno(self) -> int:
        """Return the descriptor that is readable when there is output."""
        return self._read_end

    def release(self) -> None:
        """Close the own write end, once the writer has it."""
        os.close(self.write_end)

    def pass_on(self) -> bool:
        """Copy what was printed so far; return False at its end."""
        while True:
            try:
                data = os.read(self._read_end, CHUNK_B)
            except BlockingIOError:
                return True
            if not data:
                return False
            self._put(data)

    def close(self) -> None:
        """Copy the rest, and say how much was dropped."""
        self.pass_on()
        os.close(self._read_end)
        if self._dropped_b:
            _write(
                f"\n{self._run}: {self._dropped_b} B more were printed and dropped;"
                f" at most {MAX_PRINTED_B} B of a run are shown\n"
            )

    def _put(self, data: bytes) -> None:
        shown = data[: MAX_PRINTED_B - self._printed_b]
        self._printed_b += len(shown)
        self._dropped_b += len(data) - len(shown)
        _write(self._decoder.decode(shown))


def _write(text: str) -> None:
    """Write to stderr as Python has it; what it cannot take is lost."""
    with suppress(OSError, ValueError, AttributeError):
        sys.stderr.write(text)
        sys.stderr.flush()
