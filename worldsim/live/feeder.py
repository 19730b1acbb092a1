"""The feeder of a live view: it passes a growing recording on to a server for viewers.

It is a process of its own, at the lowest priority, and the run knows nothing of it: the run writes
its recording as ever. A viewer that is slow, frozen or gone holds up the feeder alone, which keeps
one piece of the file. The feeder ends with the process that started it, and its own children end
with the feeder.
"""

import os
import select
import signal
import socket
import subprocess
import sys
from collections.abc import Sequence
from contextlib import ExitStack
from functools import partial
from pathlib import Path
from typing import NamedTuple

import msgspec

from worldsim.fleet.fork import request_death_signal
from worldsim.recording.viewer import Ports
from worldsim.recording.web_page import LOOPBACK, served_page

LOWEST_PRIORITY = 19
POLL_S = 0.1
PIECE_B = 256 * 1024
CONNECT_WITHIN_S = 0.1
CLEAR_LINE = "\r\x1b[K"
PAGE_B = os.sysconf("SC_PAGE_SIZE")


class Feed(NamedTuple):
    """What to show: a recording, to a server, and in a window where there is to be one."""

    parent: int  # pid of the process with which the feeder ends
    recording: str  # the file, which may not be there yet
    server: list[str]  # command of a server that takes a recording on its input
    ports: Ports  # where the server listens
    window: list[str]  # command of a window that connects to the server; empty: none
    browser: bool  # whether it serves a page, too
    printed: str  # file for what both print
    memory_mb: (
        int  # what either may take: rerun's own limits leave out what a viewer has yet to read
    )


def main() -> None:
    """Feed what the first argument says, until a signal or the window's end. Prints failures."""
    feed = msgspec.json.decode(sys.argv[1], type=Feed)
    request_death_signal(feed.parent, signal.SIGKILL)
    signal.signal(signal.SIGTERM, _end)
    # In a process group of its own, it may print to a terminal all the same.
    signal.signal(signal.SIGTTOU, signal.SIG_IGN)
    os.setpriority(os.PRIO_PROCESS, 0, LOWEST_PRIORITY)
    # Whatever wakes up in the run interrupts it at once.
    os.sched_setscheduler(0, os.SCHED_IDLE, os.sched_param(0))
    feeder = Feeder(feed)
    try:
        _tell(feeder.serve())
    finally:
        signal.signal(signal.SIGTERM, signal.SIG_IGN)
        feeder.end()


class Feeder:
    """A server and a window, the recording that they show, and how much of it is passed on."""

    def __init__(self, feed: Feed) -> None:
        self._feed = feed
        self._server: subprocess.Popen[bytes] | None = None
        self._window: subprocess.Popen[bytes] | None = None
        self._file: int | None = None
        self._open = False
        self._page = ExitStack()
        self._piece = b""
        """What was read and is not passed on yet."""

    def serve(self) -> str:
        """Pass on what the recording has and gets; return in a sentence why that ended."""
        server = self._server = self._start(self._feed.server, subprocess.PIPE)
        if server.stdin is None:  # there is one, since it was asked for
            raise AssertionError
        os.set_blocking(server.stdin.fileno(), False)
        while server.poll() is None:
            if self._window is not None and self._window.poll() is not None:
                return self._ended("the window", self._window.returncode)
            if not self._open and _listens(self._feed.ports.data):
                self._show()
            for name, child in (("the server", server), ("the window", self._window)):
                if child is not None and _memory_mb(child.pid) > self._feed.memory_mb:
                    return f"{name} is ended: it took more than {self._feed.memory_mb} MB"
            self._pass_on(server.stdin.fileno())
        return self._ended("the server", server.returncode)

    def _show(self) -> None:
        """Open the window, serve the page, and say where both are: the server is there."""
        self._open, shown = True, []
        if self._feed.window:
            shown.append("in a window")
            self._window = self._start(self._feed.window, subprocess.DEVNULL)
        if self._feed.browser:
            # Last: the page is served by threads, after which this process starts nothing more.
            self._page.enter_context(served_page(self._feed.ports.page, self._feed.ports.source))
            shown.append(f"open {self._feed.ports.page_address}")
        shown.append(f"other viewers: rerun --connect {self._feed.ports.data_address}")
        _tell("; ".join(shown))

    def end(self) -> None:
        """End page, window and server, stopped ones too."""
        self._page.close()
        for child in (self._window, self._server):
            if child is not None:
                child.kill()
                child.wait()

    def _pass_on(self, pipe: int) -> None:
        """Write a piece of the file, as soon as the server takes it; or wait for a moment."""
        self._piece = self._piece or self._read()
        _, ready, _ = select.select([], [pipe] if self._piece else [], [], POLL_S)
        if ready:
            try:
                self._piece = self._piece[os.write(pipe, self._piece) :]
            except BrokenPipeError:
                self._wait_for_server()

    def _wait_for_server(self) -> None:
        if self._server is not None:
            self._server.wait()

    def _read(self) -> bytes:
        if self._file is None:
            try:
                self._file = os.open(self._feed.recording, os.O_RDONLY)
            except FileNotFoundError:
                return b""
        return os.read(self._file, PIECE_B)

    def _start(self, command: Sequence[str], stdin: int) -> subprocess.Popen[bytes]:
        with Path(self._feed.printed).open("ab") as printed:
            return subprocess.Popen(
                command,
                stdin=stdin,
                stdout=printed,
                stderr=printed,
                # This process has no threads, with which a preexec_fn would be unsafe.
                preexec_fn=partial(request_death_signal, os.getpid(), signal.SIGKILL),  # noqa: PLW1509
            )

    def _ended(self, what: str, status: int) -> str:
        if status == 0:
            return f"{what} was closed"
        how = f"signal {-status}" if status < 0 else f"status {status}"
        lines = Path(self._feed.printed).read_text("utf-8", "replace").split("\n")
        last = next(
            (line.strip() for line in reversed(lines) if line.strip()), "it printed nothing"
        )
        return f"{what} ended with {how}: {last}"


def _memory_mb(pid: int) -> float:
    """Return the resident memory of a child; 0 once it has ended [MB]."""
    pages = Path(f"/proc/{pid}/statm").read_text("ascii").split()[1]
    return int(pages) * PAGE_B / 1e6


def _listens(port: int) -> bool:
    try:
        with socket.create_connection((LOOPBACK, port), CONNECT_WITHIN_S):
            return True
    except OSError:
        return False


def _tell(text: str) -> None:
    # On a terminal a progress line may be where this one begins.
    begin = CLEAR_LINE if sys.stderr.isatty() else ""
    print(f"{begin}live view: {text}", file=sys.stderr, flush=True)


def _end(_number: int, _frame: object) -> None:
    raise SystemExit(0)


if __name__ == "__main__":
    main()
