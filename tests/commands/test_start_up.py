"""A command imports what it uses: nothing slow on the way to --help, check, or a bare sim."""

import subprocess
import sys
from pathlib import Path

import pytest

PROGRAM = """
import sys
from worldsim.commands.app import command
status = command(sys.argv[1:])
heavy = {"rerun", "matplotlib", "pyarrow"} & sys.modules.keys()
print(sorted(heavy), "zenoh" in sys.modules, file=sys.stderr)
sys.exit(status)
"""


@pytest.mark.parametrize(
    "arguments",
    [
        ["--help"],
        ["sim", "--help"],
        ["check", "small.toml"],
        ["check", "--schema"],
        ["run", "--list"],
        ["new", "mine"],
        ["sim", "small.toml", "--no-recording"],
        ["sim", "small.toml", "--no-recording", "--seeds", "0:2", "--jobs", "1"],
    ],
    ids=" ".join,
)
def test_nothing_heavy_is_imported(small: Path, arguments: list[str]) -> None:
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM, *arguments],
        capture_output=True,
        text=True,
        check=False,
        cwd=small.parent,
        env={"PYTHONPATH": str(Path(__file__).parents[2])},
    )
    assert (done.returncode, done.stderr) == (0, "[] False\n")


@pytest.mark.parametrize("name", ["run", "sim", "new", "check", "verify", "view", "ps"])
def test_every_command_teaches_by_example(name: str) -> None:
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM, name, "--help"],
        capture_output=True,
        text=True,
        check=True,
        env={"PYTHONPATH": str(Path(__file__).parents[2])},
    )
    assert f"Examples:\n    qswarm {name} " in done.stdout
