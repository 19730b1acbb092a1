"""A child process that answers lines with lines; whatever it does, the caller goes on.

It ends with its caller: it is killed when the caller closes it, drops it or dies.
"""

import os
import select
import signal
import subprocess
import sys
from collections.abc import Sequence
from contextlib import suppress
from time import monotonic

MAX_LINE_B = 65_536
"""A longer line is refused."""
MAX_UNREAD_B = 4 * MAX_LINE_B
"""So much may wait to be read: more is a flood."""
READ_B = 65_536
KEPT_ERROR_B = 4_096
"""Of what the child writes to stderr, so much of the end is kept for its last line."""
END_WITHIN_S = 1.0
"""A child that has closed its output ends within this time, or its status is not told."""
_DIES_WITH_PARENT = """
import ctypes, os, signal, sys
PR_SET_PDEATHSIG = 1
ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, int(signal.SIGKILL), 0, 0, 0)
if os.getppid() == int(sys.argv[1]):
    os.execvp(sys.argv[2], sys.argv[2:])
"""
"""What becomes the command: a Python that lets itself be killed when its parent dies.

Code that runs between fork and exec could wait for ever for a lock of another thread.
"""


class ProgramError(RuntimeError):
    """A program failed: its text says all, for a trace of Python says nothing of the program."""


class ChildError(ProgramError):
    """A child that cannot be started, has ended, or does not keep to one line for one line."""


class Child:
    """A running command. Raises ChildError where it cannot be started."""

    def __init__(self, command: Sequence[str]) -> None:
        self._name = command[0]
        self._output = self._errors = b""
        self._errors_open = True
        self._owed = 0
        """Answers that have not come."""
        self.answered = 0
        """Answers that have come, the late ones too."""
        try:
            self._process = subprocess.Popen(
                [sys.executable, "-I", "-S", "-c", _DIES_WITH_PARENT, str(os.getpid()), *command],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.PIPE,
                bufsize=0,
                process_group=0,  # Ctrl-C is not meant for it, and some programs heed it anyway
            )
        except (OSError, subprocess.SubprocessError) as error:
            raise ChildError(f"{self._name!r} cannot be started: {_reason(error)}") from error
        pipes = (self._process.stdin, self._process.stdout, self._process.stderr)
        self._in, self._out, self._err = (pipe.fileno() for pipe in pipes if pipe is not None)
        for each in (self._in, self._out, self._err):
            os.set_blocking(each, False)

    def __del__(self) -> None:
        if hasattr(self, "_err"):
            self.close()

    def close(self) -> None:
        """Kill the child, and close what leads to it."""
        self._process.kill()
        with suppress(subprocess.TimeoutExpired):
            self._process.wait(END_WITHIN_S)
        for pipe in (self._process.stdin, self._process.stdout, self._process.stderr):
            if pipe is not None:
                pipe.close()

    def tell(self, line: bytes, within_s: float) -> None:
        """Write a line that is not answered. Raises ChildError where it is not taken in time."""
        if not self._write(line, monotonic() + within_s):
            raise self._failure(f"has not read a line within {within_s:g} s")

    def ask(self, line: bytes, within_s: float) -> bytes | None:
        """Return the answer to a line; None where it has not come in time [s].

        While an answer is owed, nothing is written: the answer is awaited, and dropped. Raises
        ChildError for a child that ends, writes what was not asked for, or writes no end of a line.
        """
        until = monotonic() + within_s
        while self._owed > 0:
            if self._answer(until) is None:
                return None
        self._refuse_unasked()
        if not self._write(line, until):
            raise self._failure("does not read its lines")
        self._owed += 1
        return self._answer(until)

    def _answer(self, until: float) -> bytes | None:
        """Return the next line; None where it has not come at a time."""
        while (end := self._end_of_line()) < 0:
            if not self._wait(until, writable=False):
                return None
        line, self._output = self._output[:end], self._output[end + 1 :]
        self._owed -= 1
        self.answered += 1
        return line

    def _end_of_line(self) -> int:
        """Return where the next line ends; -1 where its end has not come."""
        end = self._output.find(b"\n")
        if max(end, len(self._output) if end < 0 else 0) > MAX_LINE_B:
            raise self._failure(f"wrote a line of more than {MAX_LINE_B} bytes")
        return end

    def _refuse_unasked(self) -> None:
        self._read()
        if self._output:
            raise self._failure(f"wrote what was not asked for: {_shown(self._output)}")

    def _write(self, line: bytes, until: float) -> bool:
        """Write a line; return whether all of it was taken before a time."""
        rest = memoryview(line + b"\n")
        while rest:
            try:
                rest = rest[os.write(self._in, rest) :]
            except BlockingIOError:
                if not self._wait(until, writable=True):
                    return False
            except BrokenPipeError:
                raise self._failure("closed its input") from None
        return True

    def _wait(self, until: float, *, writable: bool) -> bool:
        """Wait until the child writes something, or reads; return False once a time is over."""
        left_s = until - monotonic()
        if left_s <= 0.0:
            return False
        readers = [self._out, self._err] if self._errors_open else [self._out]
        select.select(readers, [self._in] if writable else [], [], left_s)
        self._read()
        return True

    def _read(self) -> None:
        """Take what the child wrote."""
        self._read_errors()
        written = _taken(self._out)
        if written is None:
            raise self._failure("closed its output")
        self._output += written
        if len(self._output) > MAX_UNREAD_B:
            raise self._failure("writes more than it is asked for")

    def _read_errors(self) -> None:
        """Take what the child wrote to stderr, and pass it on."""
        errors = _taken(self._err) if self._errors_open else None
        self._errors_open = errors is not None
        if errors:
            self._errors = (self._errors + errors)[-KEPT_ERROR_B:]
            sys.stderr.write(errors.decode("utf-8", "replace"))

    def _failure(self, what: str) -> ChildError:
        """Return the error of a child that failed, with its status and its last words."""
        with suppress(subprocess.TimeoutExpired):
            if what.startswith("closed"):
                self._process.wait(END_WITHIN_S)
        self._read_errors()
        status = self._process.poll()
        told = what if status is None else _ended(status)
        last = self._errors.decode("utf-8", "replace").strip().splitlines()[-1:]
        words = f"; its last line on stderr: {last[0]!a}" if last else ""
        return ChildError(f"{self._name!r} {told}{words}")


def _taken(pipe: int) -> bytes | None:
    """Return what can be read from a pipe now; None at its end."""
    try:
        return os.read(pipe, READ_B) or None
    except BlockingIOError:
        return b""


def _ended(status: int) -> str:
    if status >= 0:
        return f"ended with status {status}"
    return f"was ended by {signal.Signals(-status).name}"


def _reason(error: Exception) -> str:
    return error.strerror or str(error) if isinstance(error, OSError) else str(error)


def _shown(output: bytes) -> str:
    return ascii(output[:80].decode("utf-8", "replace"))
