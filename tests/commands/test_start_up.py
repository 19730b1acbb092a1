"""A command imports only what it uses: --help, check and sim import nothing slow."""

import subprocess
import sys
from pathlib import Path

import pytest

from tests.commands.conftest import Command

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
        ["--version"],
        ["sim", "--help"],
        ["check", "small.toml"],
        ["check", "--schema"],
        ["run", "--list"],
        ["check", "wedge-9"],
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


COMMANDS = [
    *("run", "sim", "new", "check", "verify", "view", "ps"),
    *("netem", "mission", "fault", "bench"),
]


@pytest.mark.parametrize("name", COMMANDS)
def test_the_help_of_a_command_has_examples(qswarm: Command, name: str) -> None:
    printed = qswarm(name, "--help")
    assert printed.status == 0
    assert f"Examples:\n    qswarm {name}" in printed.out
