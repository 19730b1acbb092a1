"""A file that survives a full disk: it keeps what fits, and reports the first failure.

Rerun's own file sink does not: after a failed write every flush waits, and the process hangs when
it ends. Therefore rerun writes into a pipe that a thread always empties. The thread writes to the
file for as long as the disk allows.
"""

import os
from collections.abc import Callable
from pathlib import Path
from select import select
from threading import Lock, Thread

FULL = "/dev/full"
"""A file on which the kernel lets every write fail as on a full disk."""
CHUNK_B = 256 * 1024
FINISH_TIMEOUT_S = 10.0


class TolerantSink:
    """A new file behind a pipe; the first failed write goes to ``report``, as one line.

    Raises OSError when the file cannot be created.
    """

    def __init__(self, file: Path, report: Callable[[str], None]) -> None:
        self._name = file.name
        self._report = report
        self.failed_writes = 0
        """Number of writes that failed: the first one ends the file."""
        self._kept: int | None = None
        """The file while a full one stands in for it."""
        self._file: int | None = os.open(file, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o644)
        self._read_end, self._write_end = os.pipe()
        os.set_blocking(self._read_end, False)
        self._lock = Lock()
        """Held from the reading of data until it is written."""
        self._thread = Thread(target=self._drain, name="recording-sink", daemon=True)
        self._thread.start()

    @property
    def path(self) -> str:
        """The write end of the pipe, for the writer to open."""
        return f"/proc/self/fd/{self._write_end}"

    def fill(self, full: bool) -> None:
        """Let the file's disk be full, or no longer; what is in the pipe is written before."""
        with self._lock:
            while self._pass_on():
                pass
            self._replace_file(full)

    def _replace_file(self, full: bool) -> None:
        if self._file is None:
            return
        if full and self._kept is None:
            self._kept = os.dup(self._file)
            _replace(self._file, os.open(FULL, os.O_WRONLY))
        elif not full and self._kept is not None:
            _replace(self._file, self._kept)
            self._kept = None

    def release(self) -> None:
        """Close the own write end once the writer has opened it: the writer's close ends the pipe.

        Without this the pipe would never end.
        """
        os.close(self._write_end)

    def wait(self) -> None:
        """Wait until the writer has closed the pipe and the file is written.

        Raises TimeoutError after FINISH_TIMEOUT_S.
        """
        self._thread.join(FINISH_TIMEOUT_S)
        if self._thread.is_alive():
            raise TimeoutError(f"{self._name} was not finished within {FINISH_TIMEOUT_S:g} s")

    def _drain(self) -> None:
        while True:
            select([self._read_end], [], [])
            with self._lock:
                ended = self._pass_on() is None
            if ended:
                break
        os.close(self._read_end)
        for descriptor in (self._file, self._kept):
            if descriptor is not None:
                os.close(descriptor)

    def _pass_on(self) -> int | None:
        """Write what is in the pipe, and return how much [bytes]; None at the pipe's end."""
        try:
            data = os.read(self._read_end, CHUNK_B)
        except BlockingIOError:
            return 0
        self._write(data)
        return len(data) or None

    def _write(self, data: bytes) -> None:
        rest = memoryview(data)
        while self._file is not None and rest:
            try:
                rest = rest[os.write(self._file, rest) :]
            except OSError as error:
                os.close(self._file)
                self._file = None
                self.failed_writes += 1
                self._report(f"{self._name} ends here, the run continues: {error.strerror}")


def _replace(descriptor: int, by: int) -> None:
    os.dup2(by, descriptor)
    os.close(by)
