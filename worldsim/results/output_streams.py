"""The streams that commands print to: any text can be shown, and a failing output ends nothing.

Names, paths, recordings and errors of controllers come from elsewhere. Their control characters
are shown as escapes, so that a terminal does not obey them.
"""

import errno
import io
import os
import re
import sys
from typing import Any, TextIO

_CONTROLS = re.compile(
    "[\x00-\x08\x0b-\x1f\x7f-\x9f\u061c\u200e\u200f\u2028-\u202e\u2066-\u2069\ud800-\udfff]"
)
"""All controls but tab and newline, marks of writing direction, and lone surrogates."""


def escaped(text: str) -> str:
    """Return a text whose control characters are written as escapes, as ``repr`` writes them.

    >>> escaped("a" + chr(27)) == "a" + chr(92) + "x1b"
    True
    """
    return _CONTROLS.sub(_escape, text)


def _escape(match: re.Match[str]) -> str:
    code = ord(match[0])
    return f"\\x{code:02x}" if code < 0x100 else f"\\u{code:04x}"


class SafeStream(io.TextIOWrapper):
    """A text stream that escapes control characters, and what its encoding lacks.

    An output that cannot be written is lost: ``failure`` and ``reader_gone`` say why.
    """

    def __init__(self, descriptor: int, encoding: str) -> None:
        self._output = _Output(descriptor)
        super().__init__(
            io.BufferedWriter(self._output), encoding, "backslashreplace", line_buffering=True
        )

    @property
    def failure(self) -> str | None:
        """Why output was lost, or None."""
        return self._output.failure

    @property
    def reader_gone(self) -> bool:
        """Whether what read the output has ended, as in `qswarm ... | head`."""
        return self._output.reader_gone

    def write(self, text: str, /) -> int:
        """Write a text, escaped."""
        return super().write(escaped(text))

    def write_controls(self, text: str) -> None:
        """Write a text with control characters of our own."""
        super().write(text)


class _Output(io.RawIOBase):
    """A descriptor whose failed writes are noted."""

    def __init__(self, descriptor: int) -> None:
        self.failure: str | None = None
        self.reader_gone = False
        self._descriptor = descriptor

    def fileno(self) -> int:
        return self._descriptor

    def isatty(self) -> bool:
        return os.isatty(self._descriptor)

    def writable(self) -> bool:
        return True

    def write(self, data: Any, /) -> int:
        try:
            return os.write(self._descriptor, data)
        except BrokenPipeError:
            self.reader_gone = True
            return len(data)
        except OSError as error:
            self.failure = (error.strerror or str(error)).lower()
            return len(data)


class Unescaped:
    """A stream for programs that draw on the terminal themselves, over a stream of this process."""

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)

    def write(self, text: str) -> int:
        """Write a text as it is."""
        if isinstance(self._stream, SafeStream):
            self._stream.write_controls(text)
        else:
            self._stream.write(text)
        return len(text)


def open_streams() -> None:
    """Open this process's stdout and stderr anew as safe streams; a closed one leads nowhere.

    A closed descriptor would be reused by the next file that is opened.
    """
    for descriptor in (0, 1, 2):
        try:
            os.fstat(descriptor)
        except OSError as error:
            if error.errno != errno.EBADF:
                raise
            os.open(os.devnull, os.O_RDWR)
    sys.stdout = SafeStream(1, _encoding_of(sys.stdout))
    sys.stderr = SafeStream(2, _encoding_of(sys.stderr))


def flushed_stdout() -> SafeStream:
    """Flush stdout, and return it with what was lost."""
    assert isinstance(sys.stdout, SafeStream)  # as open_streams leaves it
    sys.stdout.flush()
    return sys.stdout


def _encoding_of(stream: TextIO | None) -> str:
    return (stream.encoding if stream is not None else None) or "utf-8"
