"""--verify: a run that is flown twice, and a controller that draws from the host."""

import json
from pathlib import Path

import pytest

from tests.commands.conftest import Command

DICE = """
import os
from agent.controller import Intent

class Dice:
    def __init__(self, setup):
        self.agent = setup.id

    def decide(self, senses):
        lucky = self.agent == 1 and senses.now_s > 0.3
        speed = os.urandom(4)[0] / 2550 if lucky else 0.0
        forward = (speed, 0.0, 0.0)
        return Intent(forward, forward, senses.yaw, 0.0, senses.position)
"""


def test_a_draw_from_the_host_is_found(
    small: Path, qswarm: Command, monkeypatch: pytest.MonkeyPatch
) -> None:
    Path("dice_of_host.py").write_text(DICE)
    monkeypatch.syspath_prepend(str(small.parent))
    options = ("--no-recording", "--duration", "0.8", "--verify", "--quiet")
    dice = ("--set", "control.controller=dice_of_host:Dice", "--out", "dice")
    printed = qswarm("sim", small, *options, *dice)
    assert printed.status == 1
    said = printed.out.splitlines()[-1]
    assert said.startswith("NOT the same twice: they part at tick 6 (0.3")
    assert "the command of agent 1; the second run is in dice/again" in said
    assert Path("dice/again/summary.json").exists()


def test_a_run_that_is_the_same_twice(small: Path, qswarm: Command) -> None:
    options = ("--no-recording", "--duration", "0.4", "--verify", "--json", "--out", "same")
    printed = qswarm("sim", small, *options)
    assert printed.status == 1  # too short to converge, flown twice or not
    assert json.loads(printed.out)["scenario"] == "small"
    assert printed.err.splitlines()[-1].startswith("the same twice: ")
    assert not Path("same/again").exists()


@pytest.mark.parametrize(
    ("command", "options", "says"),
    [
        ("run", ["--verify"], "--verify: needs --lockstep"),
        ("sim", ["--verify", "--seeds", "0:2"], "--verify: verifies one run"),
    ],
)
def test_what_cannot_be_verified_is_refused(
    small: Path, qswarm: Command, command: str, options: list[str], says: str
) -> None:
    printed = qswarm(command, small, *options)
    assert (printed.status, printed.out) == (2, "")
    assert says in printed.err
    assert list(Path().iterdir()) == [Path("small.toml")]
