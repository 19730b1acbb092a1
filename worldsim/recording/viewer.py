"""The rerun viewer on recordings: its own program, bound to loopback, without usage reports.

Nothing may leave the machine. The viewer collects usage data unless its configuration forbids it,
and it has no option to forbid it. It is therefore run with a temporary configuration; the user's
configuration is not changed. It also asks the network for its newest version and for examples, and
no option forbids that either: it gets a proxy where nobody listens.
"""

import os
import signal
import socket
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.util import find_spec
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple
from urllib.parse import quote

from worldsim.recording.layout import RECORDING_FILE
from worldsim.recording.rrd_file import is_finished, is_recording
from worldsim.recording.web_page import LOOPBACK, served_page

DATA_PORT, PAGE_PORT = 9876, 9090
"""The ports that rerun itself takes for data and for its page; others where these are taken."""
DISPLAY_VARIABLES = ("DISPLAY", "WAYLAND_DISPLAY")
_DISCARD = f"http://{LOOPBACK}:9"
NOWHERE = dict.fromkeys(("HTTP_PROXY", "HTTPS_PROXY", "ALL_PROXY"), _DISCARD)
"""Environment of a viewer: connections to other hosts are refused on this one."""


class ViewerError(Exception):
    """Recordings that cannot be viewed; the text is one line that says why."""


def recordings(runs: list[Path]) -> list[Path]:
    """Return the recordings of run folders, of folders of runs, or of files given directly.

    Raises ViewerError where there is none.
    """
    return [recording for run in runs for recording in _recordings_in(run)]


def shortcomings(found: list[Path]) -> list[str]:
    """Return what is missing of recordings, a line for each one that is not whole.

    Raises ViewerError for a file that is no recording, or cannot be read.
    """
    lines = []
    for recording in found:
        try:
            if not is_recording(recording):
                raise ViewerError(f"{recording}: not a recording")
            if not is_finished(recording):
                lines.append(f"{recording}: cut off, or still being written; shown as far as it is")
        except OSError as error:
            raise ViewerError(f"{recording}: cannot be read: {error.strerror}") from error
    return lines


def view(found: list[Path], web: bool) -> int:
    """Show recordings together until the viewer is closed; return its exit status.

    web: serve them to a browser on this machine, instead of a window. Raises ViewerError where
    there is no viewer, or no display for its window.
    """
    program = viewer_program(window=not web)
    with viewer_environment(program) as environment:
        if not web:
            return _run_until_closed([program, *_window_options(), *map(str, found)], environment)
        ports = free_ports()
        command = [program, *browser_options(ports), *map(str, found)]
        with served_page(ports.page, ports.source):
            print(f"open {ports.page_address} ; Ctrl-C ends it", flush=True)
            return _run_until_closed(command, environment)


class Ports(NamedTuple):
    """Where a server for viewers and its page are found on loopback."""

    data: int
    page: int
    source: int
    """Where rerun serves its own page."""

    @property
    def data_address(self) -> str:
        """What a viewer connects to."""
        return f"rerun+http://{LOOPBACK}:{self.data}/proxy"

    @property
    def page_address(self) -> str:
        """What to open in a browser."""
        return f"http://{LOOPBACK}:{self.page}/?url={quote(self.data_address, safe='')}&theme=dark"


def viewer_program(*, window: bool) -> str:
    """Return the viewer's binary: the script of the same name would leave it orphaned.

    Raises ViewerError where there is no viewer, or, for a window, no display.
    """
    spec = find_spec("rerun_cli")
    program = Path(spec.origin).with_name("rerun") if spec is not None and spec.origin else None
    if program is None or not program.is_file():
        raise ViewerError("the rerun viewer is not installed: pip install rerun-sdk")
    if window and sys.platform == "linux" and not any(map(os.environ.get, DISPLAY_VARIABLES)):
        raise ViewerError("no display for a window here; --web shows it in a browser")
    return str(program)


@contextmanager
def viewer_environment(program: str) -> Iterator[dict[str, str]]:
    """Yield the environment of a viewer that sends nothing to other hosts. Raises ViewerError."""
    with TemporaryDirectory(prefix="qswarm-viewer-") as configuration:
        quiet = {"RUST_LOG": "warn", **os.environ}
        for name in NOWHERE:
            quiet.pop(name.lower(), None)
        environment = {**quiet, **NOWHERE, "XDG_CONFIG_HOME": configuration}
        _disable_usage_reports(program, environment)
        yield environment


def free_ports(wanted_data: int = DATA_PORT, wanted_page: int = PAGE_PORT) -> Ports:
    """Return free ports: those that are wanted for data and page, where they are free."""
    with socket.socket() as data, socket.socket() as page, socket.socket() as source:
        return Ports(_bound(data, wanted_data), _bound(page, wanted_page), _bound(source, 0))


def browser_options(ports: Ports) -> list[str]:
    """Return the options of a server for a browser."""
    numbers = ["--port", str(ports.data), "--web-viewer-port", str(ports.source)]
    return ["--serve-web", "--bind", LOOPBACK, *numbers]


def _recordings_in(run: Path) -> list[Path]:
    if run.is_file():
        return [run]
    if not run.exists():
        raise ViewerError(f"{run}: no such run")
    own = run / RECORDING_FILE
    found = [own] if own.is_file() else sorted(run.glob(f"*/{RECORDING_FILE}"))
    if not found:
        raise ViewerError(f"{run}: no recording in it: not a run, or a run with --no-recording")
    return found


def _disable_usage_reports(program: str, environment: dict[str, str]) -> None:
    done = subprocess.run(
        [program, "analytics", "disable"], env=environment, capture_output=True, check=False
    )
    if done.returncode != 0:
        raise ViewerError("usage reports of the rerun viewer cannot be disabled; not started")


def _window_options() -> list[str]:
    return ["--hide-welcome-screen", "--bind", LOOPBACK, "--port", "auto"]


def _run_until_closed(command: list[str], environment: dict[str, str]) -> int:
    """Run the viewer until it ends; Ctrl-C and SIGTERM end it with status 0."""
    before = signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        return subprocess.run(command, env=environment, check=False).returncode
    except KeyboardInterrupt:
        return 0
    finally:
        signal.signal(signal.SIGTERM, before)


def _bound(probe: socket.socket, wanted: int) -> int:
    # As servers do: else a port that was used a moment ago would seem taken.
    probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        probe.bind((LOOPBACK, wanted))
    except OSError:
        probe.bind((LOOPBACK, 0))
    return int(probe.getsockname()[1])
