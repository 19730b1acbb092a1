"""A run that is watched while it flies: the run itself, and beside it a feeder with its viewers.

Viewers get the recording by way of its file, so the run is the same whether anybody watches.
"""

import os
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple

import msgspec

from worldsim.live.feeder import Feed
from worldsim.recording.viewer import (
    Ports,
    ViewerError,
    browser_options,
    free_ports,
    viewer_environment,
    viewer_program,
)
from worldsim.recording.web_page import LOOPBACK
from worldsim.results.exit_status import INTERRUPTED

SERVER_MEMORY, WINDOW_MEMORY = "512MB", "1GB"
"""Beyond these, rerun drops the oldest data: of what late viewers get, and of what one shows."""
MEMORY_MB = 2000
"""What server and window may take each; one that takes more ends the live view."""
END_WITHIN_S = 2.0


class LiveView(NamedTuple):
    """Where a run is shown while it flies. Nowhere: it is not watched."""

    window: bool = False
    browser: bool = False

    @property
    def wanted(self) -> bool:
        """Whether the run is watched at all."""
        return self.window or self.browser

    def check(self) -> None:
        """Raise ViewerError where there is no viewer, or no display for its window."""
        if self.wanted:
            try:
                viewer_program(window=self.window)
            except ViewerError as error:
                raise ViewerError(str(error).replace("--web", "--live-web")) from error

    def watch(self, recording: Path, fly: Callable[[], int]) -> int:
        """Fly, and show the recording meanwhile; return the exit status of the flight.

        recording: the file that the flight will write. One that is there already is another run's,
        which the flight refuses to overwrite, so it is not shown. After the flight the viewers
        stay until they are closed, or until Ctrl-C, if the command runs on a terminal. They are
        ended at once where it does not, and where the flight was interrupted.
        """
        if not self.wanted or recording.exists():
            return fly()
        with self._fed(recording) as feeder:
            status = fly()
            if status != INTERRUPTED and sys.stdin is not None and sys.stdin.isatty():
                _wait_until_closed(feeder)
        return status

    @contextmanager
    def _fed(self, recording: Path) -> Iterator[subprocess.Popen[bytes]]:
        program = viewer_program(window=self.window)
        with viewer_environment(program) as environment:
            ports = free_ports()
            feed = Feed(
                parent=os.getpid(),
                recording=str(recording),
                server=[program, *self._server_options(ports), "-"],
                ports=ports,
                window=[program, *_window_options(ports)] if self.window else [],
                browser=self.browser,
                printed=str(Path(environment["XDG_CONFIG_HOME"]) / "viewer.log"),
                memory_mb=MEMORY_MB,
            )
            # A process group of its own: Ctrl-C is for the run, which then ends the feeder.
            feeder = subprocess.Popen(
                [
                    sys.executable,
                    "-P",
                    "-m",
                    "worldsim.live.feeder",
                    msgspec.json.encode(feed).decode(),
                ],
                stdin=subprocess.DEVNULL,
                env=environment,
                process_group=0,
            )
            try:
                yield feeder
            finally:
                _end(feeder)

    def _server_options(self, ports: Ports) -> list[str]:
        memory = ["--server-memory-limit", SERVER_MEMORY]
        if self.browser:
            return [*browser_options(ports), *memory]
        return ["--serve-grpc", "--bind", LOOPBACK, "--port", str(ports.data), *memory]


def _window_options(ports: Ports) -> list[str]:
    return [
        *("--connect", ports.data_address),
        *("--bind", LOOPBACK, "--port", "auto"),
        *("--memory-limit", WINDOW_MEMORY, "--hide-welcome-screen"),
    ]


def _wait_until_closed(feeder: subprocess.Popen[bytes]) -> None:
    """Wait until the window is closed, or for Ctrl-C, SIGTERM or the terminal's end."""
    if feeder.poll() is not None:
        return
    _tell("live view: it stays open; Ctrl-C ends it")
    numbers = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
    before = {number: signal.signal(number, signal.default_int_handler) for number in numbers}
    try:
        feeder.wait()
    except KeyboardInterrupt:
        pass
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def _end(feeder: subprocess.Popen[bytes]) -> None:
    """End the feeder, a stopped one too; what it started ends with it."""
    feeder.terminate()
    try:
        feeder.wait(END_WITHIN_S)
    except subprocess.TimeoutExpired:
        feeder.kill()
        feeder.wait()


def _tell(text: str) -> None:
    print(text, file=sys.stderr, flush=True)
