"""A small scenario that flies in a blink, and the command line with what it printed."""

import os
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import pytest

from worldsim.commands.app import command

SMALL = """
name = "small"
duration_s = 5.0
[fleet]
agents = 2
start = { kind = "list", positions_m = [[0.3, 0, 0], [-1.3, 0, 0]] }
[formation]
name = "line"
vertices = { V1 = [0, 0, 0] }
queue = [{ name = "Q", vertices = ["V1"], shape = { kind = "ray", direction = [-1, 0, 0] } }]
"""


class TelemetryRow(NamedTuple):
    """What a command left behind: its exit status and what it said."""

    status: int
    out: str
    err: str


Command = Callable[..., TelemetryRow]


@pytest.fixture
def small(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The scenario's file, in an empty folder that is the present one."""
    monkeypatch.chdir(tmp_path)
    file = tmp_path / "small.toml"
    file.write_text(SMALL)
    return file


@pytest.fixture
def qswarm(capsys: pytest.CaptureFixture[str]) -> Command:
    def run(*arguments: str | os.PathLike[str]) -> TelemetryRow:
        status = command([os.fspath(argument) for argument in arguments])
        return TelemetryRow(status, *capsys.readouterr())

    return run
