"""Processes under test: each started in a session of its own, with its output in a file."""

import json
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from worldsim.recording.viewer import viewer_program

SCENARIO = """
name = "four"
seed = 3
duration_s = {duration_s}

[fleet]
agents = 4
start = {{ kind = "list", positions_m = [[0.4, 0, 0], [-1.3, 0.2, 0], [-2.2, -0.2, 0.1], [-3.1, 0, 0]] }}

[formation]
name = "line"
[formation.vertices]
V1 = [0, 0, 0]
[[formation.queue]]
name = "Q1"
vertices = ["V1"]
shape = {{ kind = "ray", direction = [-1, 0, 0] }}

[netem]
range_m = 6.0
delay_ms = 10

[expect]
converge_within_s = 6.0
"""  # noqa: E501
QSWARM = [sys.executable, "-c", "from worldsim.commands.app import main; main()"]


class Started:
    """A process whose output goes to a file; as a context, it ends with all that it started."""

    def __init__(self, arguments: list[str], output: Path, folder: Path) -> None:
        self._output = output
        path = os.pathsep.join([str(Path(__file__).parents[2]), str(folder)])
        with output.open("wb") as file:
            self.process = subprocess.Popen(
                arguments,
                stdin=subprocess.DEVNULL,
                stdout=file,
                stderr=subprocess.STDOUT,
                start_new_session=True,
                cwd=folder,
                env={**os.environ, "PYTHONPATH": path, "PYTHONUNBUFFERED": "1"},
            )

    def __enter__(self) -> "Started":
        return self

    def __exit__(self, *_: object) -> None:
        if self.process.poll() is None:
            self.kill_group(signal.SIGKILL)
            self.process.wait(5.0)

    @property
    def text(self) -> str:
        return self._output.read_text()

    def status(self, within_s: float) -> int:
        return self.process.wait(within_s)

    def wait_for_output(self, text: str, within_s: float = 15.0) -> None:
        eventually(lambda: text in self.text, within_s, lambda: f"{text!r} in {self.text!r}")

    def kill_group(self, number: signal.Signals) -> None:
        os.killpg(self.process.pid, number)


def eventually(
    condition: Callable[[], bool], within_s: float, what: Callable[[], str] = lambda: ""
) -> None:
    deadline, pause = time.monotonic() + within_s, threading.Event()
    while not condition():
        assert time.monotonic() < deadline, f"not within {within_s:g} s: {what()}"
        pause.wait(0.05)


def events_of(run: Path) -> list[dict[str, Any]]:
    return [json.loads(line) for line in (run / "events.jsonl").read_text().splitlines()]


def pids(run: Path) -> dict[str, int]:
    rows = json.loads((run / "fleet.json").read_text())["processes"]
    return {row["name"]: row["pid"] for row in rows}


def rrd_verify(recording: Path) -> int:
    """Return the exit status of ``rerun rrd verify``."""
    program = viewer_program(window=False)
    verifier = [program, "rrd", "verify", recording]
    return subprocess.run(verifier, check=False, capture_output=True).returncode
