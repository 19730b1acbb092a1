"""A small scenario that runs in a moment, and the command line with what it printed."""

import os
import re
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import pytest

from tests.small_scenario import SMALL
from worldsim.commands.app import command


class Printed(NamedTuple):
    """A command's exit status, and what it printed on stdout and stderr."""

    status: int
    out: str
    err: str


Command = Callable[..., Printed]
PROGRESS = re.compile(r"\d+ of \d+ runs done, .*\n|[0-9.]+ of [0-9.]+ s.*\n")
"""What a slow host prints besides."""


@pytest.fixture
def small(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The small scenario's file, alone in the current folder."""
    monkeypatch.chdir(tmp_path)
    file = tmp_path / "small.toml"
    file.write_text(SMALL)
    return file


@pytest.fixture
def qswarm(capsys: pytest.CaptureFixture[str]) -> Command:
    def run(*arguments: str | os.PathLike[str]) -> Printed:
        status = command([os.fspath(argument) for argument in arguments])
        return Printed(status, *capsys.readouterr())

    return run
