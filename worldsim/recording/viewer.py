"""The rerun viewer on recordings: its own program, bound to this machine, telling nobody.

The viewer collects usage data unless its configuration says not to, and no option of it says so.
It is therefore given a configuration of its own for as long as it runs; the user's stays as it is.
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

LOOPBACK = "127.0.0.1"
RECORDING = "run.rrd"
DISPLAYS = ("DISPLAY", "WAYLAND_DISPLAY")


class ViewerError(Exception):
    """Recordings that cannot be viewed; one line that says why."""


def recordings(runs: list[Path]) -> list[Path]:
    """Return the recordings of runs: run folders, folders of runs, or recordings themselves.

    Raises ViewerError where one has none.
    """
    return [recording for run in runs for recording in _of(run)]


def view(found: list[Path], web: bool) -> int:
    """Show recordings together, and wait until the viewer is left; return its exit status.

    web: serve them to a browser on this machine; else a window. Raises ViewerError where there is
    no viewer, or no display for its window.
    """
    program = _program()
    if not web and sys.platform == "linux" and not any(map(os.environ.get, DISPLAYS)):
        raise ViewerError("no display for a window here; --web shows it in a browser")
    with TemporaryDirectory(prefix="qswarm-viewer-") as configuration:
        quiet = {"RUST_LOG": "warn", **os.environ}
        environment = {**quiet, "XDG_CONFIG_HOME": configuration}
        _ask_for_silence(program, environment)
        command = [program, *(_web() if web else _window()), *map(str, found)]
        return _attended(command, environment)


def _of(run: Path) -> list[Path]:
    if run.is_file():
        return [run]
    if not run.exists():
        raise ViewerError(f"{run}: no such run")
    found = [run / RECORDING] if (run / RECORDING).is_file() else sorted(run.glob(f"*/{RECORDING}"))
    if not found:
        raise ViewerError(f"{run}: no recording in it: it was flown with --no-recording, or not")
    return found


def _program() -> str:
    """Return the viewer itself: the script of that name is a parent that leaves it orphaned."""
    spec = find_spec("rerun_cli")
    program = Path(spec.origin).with_name("rerun") if spec is not None and spec.origin else None
    if program is None or not program.is_file():
        raise ViewerError("the rerun viewer is not installed: pip install rerun-sdk")
    return str(program)


def _ask_for_silence(program: str, environment: dict[str, str]) -> None:
    asked = subprocess.run(
        [program, "analytics", "disable"], env=environment, capture_output=True, check=False
    )
    if asked.returncode != 0:
        raise ViewerError("the rerun viewer would not leave off collecting usage data")


def _window() -> list[str]:
    return ["--bind", LOOPBACK, "--port", "auto"]


def _web() -> list[str]:
    data, page = _free_ports(2)
    source = quote(f"rerun+http://{LOOPBACK}:{data}/proxy", safe="")
    print(f"open http://{LOOPBACK}:{page}/?url={source} ; Ctrl-C ends it", flush=True)
    ports = ["--port", str(data), "--web-viewer-port", str(page)]
    return ["--serve-web", "--bind", LOOPBACK, *ports]


def _attended(command: list[str], environment: dict[str, str]) -> int:
    """Run the viewer to its end; Ctrl-C and SIGTERM are ways to leave it like any other."""
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
