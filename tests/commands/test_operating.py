"""Commands to a running fleet, where there is none, or where they say nothing."""

import json
import os
from pathlib import Path

import pytest

from tests.commands.conftest import Command


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("fault", "run", "explode", "2"), "'explode'; kill, leave, restart, pause, resume, join"),
        (("fault", "run", "join", "some"), "'some'; a number from 0"),
        (("netem", "run", "explode"), "'explode'; show, set, partition, heal, jam, flap"),
        (("netem", "run", "partition", "a,b"), "'a'; a number from 0"),
        (("netem", "run", "set", "loss"), "WORD: 'loss'; write it as KEY=VALUE"),
        (("netem", "run", "set", "=3"), "WORD: '=3'; write it as KEY=VALUE"),
        (("netem", "run", "show", "links"), "WORD: 'links'; show stands alone"),
        (("netem", "run", "heal", "0,1"), "WORD: '0,1'; heal stands alone"),
        (("mission", "run"), "a formation file or --frame, one of them"),
        (("mission", "run", "there.toml", "--frame", "yaw_deg=1"), "one of them"),
        (("mission", "run", "missing.toml"), "missing.toml: no such file"),
        (("netem", "run", "show"), "run: not a process run (no fleet.json)"),
        (("fault", "run", "kill", "2"), "run: not a process run (no fleet.json)"),
    ],
)
def test_bad_input_is_one_line_and_status_2(
    small: Path, qswarm: Command, words: tuple[str, ...], said: str
) -> None:
    told = qswarm(*words)
    assert (told.status, told.out) == (2, "")
    assert said in told.err
    assert told.err.count("\n") == 1


def test_a_fleet_that_has_landed_is_told(small: Path, qswarm: Command) -> None:
    Path("run").mkdir()
    row = {"name": "world", "pid": os.getpid(), "started": 1}
    fleet = {"run": "small", "endpoint": "tcp/127.0.0.1:9", "processes": [row]}
    Path("run/fleet.json").write_text(json.dumps(fleet))
    told = qswarm("fault", "run", "kill", "2")
    assert (told.status, told.err) == (2, "run: the run has ended\n")
