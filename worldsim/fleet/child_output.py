"""Where a child process reads and writes: its log is bounded, and survives a full disk.

A log keeps the first MAX_LOG_B and, written when the process ends, the last KEPT_TAIL_B; one line
between them says how much was dropped.
"""

import errno
import io
import os
import sys
from collections import deque
from contextlib import suppress
from pathlib import Path
from typing import Any

MAX_LOG_B = 1024 * 1024
KEPT_TAIL_B = 32 * 1024


class LogStream(io.RawIOBase):
    """Writes to descriptor 1, the log, or to a fallback when the log cannot be written.

    On a full disk the end of the recording must still be reported, and a failed report must not
    end the process.
    """

    def __init__(self, fallback: int) -> None:
        self._fallback = fallback
        self._written_b = 0
        self._dropped_b = 0
        self._tail: deque[bytes] = deque()
        self._tail_b = 0

    def writable(self) -> bool:
        """Return True."""
        return True

    def write(self, data: Any, /) -> int:
        """Write to the log, else to the fallback; data that neither accepts is lost."""
        if self._written_b < MAX_LOG_B:
            count = self._put(memoryview(data)[: MAX_LOG_B - self._written_b])
            self._written_b += count
            return count
        return self._keep(bytes(data))

    def finish(self) -> None:
        """Write how much was dropped, and the last output."""
        if self._tail:
            tail, self._tail = b"".join(self._tail), deque()
            mark = f"\n[{self._dropped_b} B dropped: a log holds {MAX_LOG_B} B and its end]\n"
            self._put(mark.encode() + tail)

    def _keep(self, data: bytes) -> int:
        """Keep the newest output in memory, and count what is dropped."""
        kept = data[-KEPT_TAIL_B:]
        self._dropped_b += len(data) - len(kept)
        self._tail.append(kept)
        self._tail_b += len(kept)
        while self._tail_b - len(self._tail[0]) >= KEPT_TAIL_B:
            oldest = self._tail.popleft()
            self._tail_b -= len(oldest)
            self._dropped_b += len(oldest)
        return len(data)

    def _put(self, data: Any) -> int:
        try:
            return os.write(1, data)
        except OSError as error:
            # The fallback is the terminal; when it is gone as well, no reader is left. A file over
            # its size limit is full for this process alone.
            if error.errno != errno.EFBIG:
                with suppress(OSError):
                    os.write(self._fallback, data)
            return len(data)


_logs: list[LogStream] = []
"""The log of this process, if it has one."""


def redirect_output(output: Path | int | None) -> None:
    """Write to a log file or a descriptor, whatever the parent's streams are; None: keep its own.

    Input is /dev/null, and the parent's with a descriptor.
    """
    if isinstance(output, int):
        os.dup2(output, 1)
        os.dup2(output, 2)
        sys.stdout, sys.stderr = _text_stream(1), _text_stream(2)
        return
    _replace(0, os.open(os.devnull, os.O_RDONLY))
    if output is None:
        sys.stdout, sys.stderr = _text_stream(1), _text_stream(2)
        return
    fallback = os.dup(2)
    _replace(1, os.open(output, os.O_WRONLY | os.O_CREAT | os.O_APPEND, 0o644))
    os.dup2(1, 2)
    _logs[:] = [LogStream(fallback)]
    buffered = io.BufferedWriter(_logs[0])
    sys.stdout = sys.stderr = io.TextIOWrapper(
        buffered, encoding="utf-8", errors="backslashreplace", line_buffering=True
    )


def flush_output() -> None:
    """Write what is buffered; what cannot be written is lost."""
    for stream in (sys.stdout, sys.stderr):
        # A closed stream raises ValueError, and one that was taken away is None.
        with suppress(OSError, ValueError, AttributeError):
            stream.flush()


def finish_output() -> None:
    """Write what is buffered, and the end of the log, before this process ends."""
    flush_output()
    for log in _logs:
        log.finish()


def _text_stream(descriptor: int) -> io.TextIOWrapper:
    return os.fdopen(descriptor, "w", 1, encoding="utf-8", errors="backslashreplace", closefd=False)


def _replace(descriptor: int, replacement: int) -> None:
    if replacement != descriptor:
        os.dup2(replacement, descriptor)
        os.close(replacement)
