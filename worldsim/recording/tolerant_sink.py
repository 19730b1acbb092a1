"""A file that takes whatever it is given, and says once when the disk does not.

Rerun's own file sink cannot be trusted with a full disk: its writer dies, every flush then waits,
and the process hangs when it ends. So rerun writes into a pipe that is always emptied, and what
comes out of the pipe is kept for as long as the disk allows.
"""

import os
from collections.abc import Callable
from pathlib import Path
from threading import Thread

CHUNK_B = 256 * 1024
END_S = 10.0


class TolerantSink:
    """A new file behind a pipe; ``path`` is what a writer opens, ``size`` what is kept [bytes].

    ``say`` hears of the first failure. Raises OSError when the file cannot be created.
    """

    def __init__(self, file: Path, say: Callable[[str], None]) -> None:
        self._name = file.name
        self._say = say
        self._out: int | None = os.open(file, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o644)
        self._exit, self._entrance = os.pipe()
        self._thread = Thread(target=self._drain, name="spool", daemon=True)
        self._thread.start()

    @property
    def path(self) -> str:
        """The pipe's entrance, for a writer to open."""
        return f"/proc/self/fd/{self._entrance}"

    def opened(self) -> None:
        """Leave the pipe to the writer that opened it: it ends when the writer closes it."""
        os.close(self._entrance)

    def wait(self) -> None:
        """Wait until the writer has closed the pipe and the file holds everything."""
        self._thread.join(END_S)
        if self._thread.is_alive():
            raise TimeoutError(f"{self._name} was not finished within {END_S:g} s")

    def _drain(self) -> None:
        while taken := os.read(self._exit, CHUNK_B):
            self._keep(taken)
        os.close(self._exit)
        if self._out is not None:
            os.close(self._out)

    def _keep(self, taken: bytes) -> None:
        rest = memoryview(taken)
        while self._out is not None and rest:
            try:
                rest = rest[os.write(self._out, rest) :]
            except OSError as error:
                os.close(self._out)
                self._out = None
                self._say(f"{self._name} ends here, the run goes on: {error.strerror}")
