"""The rerun viewer on recordings: its own program, bound to loopback, without usage reports.

The viewer collects usage data unless its configuration forbids it, and it has no option to forbid
it. It is therefore run with a temporary configuration; the user's configuration is not changed.
"""

import os
import signal
import socket
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path
from tempfile import TemporaryDirectory
from urllib.parse import quote

from worldsim.recording.layout import RECORDING_FILE

LOOPBACK = "127.0.0.1"
DISPLAY_VARIABLES = ("DISPLAY", "WAYLAND_DISPLAY")


class ViewerError(Exception):
    """Recordings that cannot be viewed; the text is one line that says why."""


def recordings(runs: list[Path]) -> list[Path]:
    """Return the recordings of run folders, of folders of runs, or of files given directly.

    Raises ViewerError where there is none.
    """
    return [recording for run in runs for recording in _recordings_in(run)]


def view(found: list[Path], web: bool) -> int:
    """Show recordings together until the viewer is closed; return its exit status.

    web: serve them to a browser on this machine, instead of a window. Raises ViewerError where
    there is no viewer, or no display for its window.
    """
    program = _viewer_program()
    if not web and sys.platform == "linux" and not any(map(os.environ.get, DISPLAY_VARIABLES)):
        raise ViewerError("no display for a window here; --web shows it in a browser")
    with TemporaryDirectory(prefix="qswarm-viewer-") as configuration:
        quiet = {"RUST_LOG": "warn", **os.environ}
        environment = {**quiet, "XDG_CONFIG_HOME": configuration}
        _disable_usage_reports(program, environment)
        command = [program, *(_web_options() if web else _window_options()), *map(str, found)]
        return _run_until_closed(command, environment)


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


def _viewer_program() -> str:
    """Return the viewer's binary: the script of the same name would leave it orphaned."""
    spec = find_spec("rerun_cli")
    program = Path(spec.origin).with_name("rerun") if spec is not None and spec.origin else None
    if program is None or not program.is_file():
        raise ViewerError("the rerun viewer is not installed: pip install rerun-sdk")
    return str(program)


def _disable_usage_reports(program: str, environment: dict[str, str]) -> None:
    done = subprocess.run(
        [program, "analytics", "disable"], env=environment, capture_output=True, check=False
    )
    if done.returncode != 0:
        raise ViewerError("usage reports of the rerun viewer cannot be disabled; not started")


def _window_options() -> list[str]:
    return ["--bind", LOOPBACK, "--port", "auto"]


def _web_options() -> list[str]:
    """Return the options that serve a browser, and print the address to open."""
    data, page = _free_ports(2)
    source = quote(f"rerun+http://{LOOPBACK}:{data}/proxy", safe="")
    print(f"open http://{LOOPBACK}:{page}/?url={source} ; Ctrl-C ends it", flush=True)
    ports = ["--port", str(data), "--web-viewer-port", str(page)]
    return ["--serve-web", "--bind", LOOPBACK, *ports]


def _run_until_closed(command: list[str], environment: dict[str, str]) -> int:
    """Run the viewer until it ends; Ctrl-C and SIGTERM end it with status 0."""
    before = signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        return subprocess.run(command, env=environment, check=False).returncode
    except KeyboardInterrupt:
        return 0
    finally:
        signal.signal(signal.SIGTERM, before)


def _free_ports(count: int) -> list[int]:
    probes = [socket.socket() for _ in range(count)]
    try:
        for probe in probes:
            probe.bind((LOOPBACK, 0))
        return [int(probe.getsockname()[1]) for probe in probes]
    finally:
        for probe in probes:
            probe.close()
