"""The page on lines: its programs fly as they stand there, where their languages are installed."""

import re
import shutil
import subprocess
from math import sqrt
from pathlib import Path

import pytest

from agent.config import AgentSetup
from agent.controller import Intent, Senses
from tests.tutorial.page import blocks
from worldsim.commands.app import command
from worldsim.engine.preflight import VIRTUAL_COMMAND_TICKS, admit
from worldsim.engine.virtual import fly
from worldsim.scenario.file import load

PAGE = Path(__file__).parents[2] / "docs" / "lines.md"
NAMED = re.compile(r"^(?:#!.*\n)?(?:#|//) ([\w.]+)")


class Ring:
    """The controller of the page, in Python."""

    Parameters = dict

    def __init__(self, setup: AgentSetup, parameters: dict[str, float]) -> None:
        self._radius = parameters["ring_m"]

    def decide(self, senses: Senses) -> Intent:
        """Return what the programs of the page say."""
        x, y, z = senses.position
        r = max(sqrt(x * x + y * y), 0.1)
        u = ((self._radius - r) * x - 0.3 * y) / r
        v = ((self._radius - r) * y + 0.3 * x) / r
        w = -z
        n = max(1.0, sqrt(u * u + v * v + w * w))
        velocity = (u / n, v / n, w / n)
        return Intent(
            velocity,
            velocity,
            senses.yaw,
            force=sqrt(sum(each * each for each in velocity)),
            heading_for=(x + velocity[0], y + velocity[1], z + velocity[2]),
        )


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The files of the page."""
    base = tmp_path_factory.mktemp("lines")
    for block in blocks(PAGE.read_text()):
        found = NAMED.match(block.text)
        if found is not None:
            (base / found[1]).write_text(block.text)
    assert {each.name for each in base.iterdir()} == {"ring.toml", "ring.c", "ring.pl", "meeting.c"}
    return base


def build(program: str, folder: Path) -> None:
    """Compile a program of the page as it says."""
    lines = [line for block in blocks(PAGE.read_text()) for line in block.text.splitlines()]
    (said,) = [line for line in lines if line.startswith("gcc") and f"-o {program} " in line]
    subprocess.run(said, shell=True, check=True, cwd=folder)


def trace_of(folder: Path, control: str, radius_m: float = 3.0) -> str:
    """Return the trace of a flight of the page's scenario; control: what decides in it."""
    file = folder / "flown.toml"
    text = (folder / "ring.toml").read_text()
    assert 'command = ["./ring"]' in text
    file.write_text(text.replace('command = ["./ring"]', control))
    overrides = {"duration_s": "4", "control.parameters.ring_m": str(radius_m)}
    flight = fly(admit(load(file, overrides), file, VIRTUAL_COMMAND_TICKS))
    assert (flight.loop.judge.min_separation_m or 0.0) > 0.25
    return flight.loop.trace.sha256


def test_a_program_in_c_flies_as_the_same_controller_in_python(folder: Path) -> None:
    if shutil.which("gcc") is None:
        pytest.skip("gcc is not installed")
    build("ring", folder)
    own = 'command = ["./ring"]'
    same = trace_of(folder, own)
    assert same == trace_of(folder, f'controller = "{__name__}:Ring"')
    assert same != trace_of(folder, own, radius_m=2.0)


def test_a_program_in_perl_flies_the_same_each_time(folder: Path) -> None:
    if subprocess.run(["perl", "-MJSON::PP", "-e", "1"], check=False).returncode != 0:
        pytest.skip("perl is not installed")
    perl = 'command = ["perl", "ring.pl"]'
    assert trace_of(folder, perl) == trace_of(folder, perl)


def test_a_command_that_cannot_be_run_is_named(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for given, said in (
        ("['./none']", "control.command[0]: './none' does not exist"),
        ("['./ring.c']", "control.command[0]: './ring.c' is not executable"),
        ("['no-such-program']", "control.command[0]: 'no-such-program' does not exist"),
        ('["./ring\\u0000x"]', "control.command[0]: holds a NUL"),
        ("['perl', \"a\\u0000b\"]", "control.command[1]: holds a NUL"),
        ("[]", "control.command: got a list of 0; allowed: a list of 1 to 64"),
    ):
        arguments = ["check", str(folder / "ring.toml"), "--set", f"control.command={given}"]
        assert command(arguments) == 2
        assert said in capsys.readouterr().err
    both = ["--set", "control.command=['perl']", "--set", "control.controller=flocking"]
    assert command(["check", str(folder / "ring.toml"), *both]) == 2
    assert "cannot be combined with control.controller = 'flocking'" in capsys.readouterr().err


def test_the_schema_of_the_lines_is_printed(capsys: pytest.CaptureFixture[str]) -> None:
    assert command(["check", "--line-schema"]) == 0
    assert '"IntentLine"' in capsys.readouterr().out
