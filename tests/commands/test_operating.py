"""Commands to a running fleet: bad input, and fleets that are not running."""

import json
import os
from pathlib import Path

import pytest

from tests.commands.conftest import Command


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (
            ("fault", "run", "explode", "2"),
            "'explode'; allowed: kill, leave, restart, pause, resume, join",
        ),
        (("fault", "run", "heal"), "'heal'; it is of the radio; write qswarm netem run heal"),
        (
            ("netem", "run", "kill", "2"),
            "'kill'; it is not of the radio; write qswarm fault run kill",
        ),
        (("netem", "run", "jam", "for_s=2"), "'for_s=2'; it is an option; write --for VALUE"),
        (("fault", "run", "join", "some"), "SELECTOR: 'some'; a whole number from 0"),
        (
            ("netem", "run", "explode"),
            "ACTION: 'explode'; allowed: show, set, partition, heal, jam, flap, sabotage",
        ),
        (
            ("fault", "run", "clock", "3", "offset_s=3", "offset_s=4"),
            "KEY=VALUE: 'offset_s=4'; offset_s is given before",
        ),
        (
            ("netem", "run", "set", "multihop={}", "multihop.delay_ms=4"),
            "'multihop.delay_ms=4'; multihop is given before",
        ),
        (
            ("mission", "run", "--frame", "yaw_deg=4", "--frame", "yaw_deg=4"),
            "'yaw_deg=4'; yaw_deg is given before",
        ),
        (
            ("fault", "run", "disk_full", "later"),
            "SELECTOR: 'later'; disk_full strikes no agents; write it alone: it begins at once",
        ),
        (("fault", "run", "disk_full"), "run: no such folder"),
        (("fault", "run", "disk_full", "now"), "run: no such folder"),
        (("fault", "run", "intruder"), "run: no such folder"),
        (("fault", "run", "kill"), "SELECTOR: name agents, or all"),
        (("fault", "run", "join"), "SELECTOR: say how many agents join"),
        (("fault", "run", "end"), "SELECTOR: name the fault to end"),
        (("netem", "run", "partition"), "partition: write groups, e.g. 0,1/2,3 (see qswarm netem"),
        (("netem", "run", "partition", "a,b"), "'a'; a whole number from 0"),
        (("netem", "run", "set", "loss"), "'loss'; write it as KEY=VALUE"),
        (("netem", "run", "set", "=3"), "'=3'; write it as KEY=VALUE"),
        (("netem", "run", "show", "links"), "'links'; show takes no further words"),
        (("netem", "run", "heal", "0,1"), "'0,1'; heal takes no further words"),
        (("mission", "run"), "either a formation or --frame"),
        (("mission", "run", "there.toml", "--frame", "yaw_deg=1"), "exactly one of them"),
        (("mission", "run", "missing.toml"), "missing.toml: no such file"),
        (("mission", "run", "helx"), "no such formation in the library; closest: helix"),
        (("netem", "run", "show"), "run: no such folder"),
        (("fault", "run", "kill", "2"), "run: no such folder"),
    ],
)
def test_bad_input_is_one_line_and_status_2(
    small: Path, qswarm: Command, words: tuple[str, ...], says: str
) -> None:
    printed = qswarm(*words)
    assert (printed.status, printed.out) == (2, "")
    assert says in printed.err
    assert printed.err.count("\n") == 1


def test_a_fleet_that_has_ended_is_an_error(small: Path, qswarm: Command) -> None:
    Path("run").mkdir()
    row = {"name": "world", "pid": os.getpid(), "started": 1}
    fleet = {"run": "small", "endpoint": "tcp/127.0.0.1:9", "processes": [row]}
    Path("run/fleet.json").write_text(json.dumps(fleet))
    printed = qswarm("fault", "run", "kill", "2")
    assert (printed.status, printed.err) == (2, "run: the run has ended\n")


def test_ps_has_a_header_and_a_row_for_each_process(small: Path, qswarm: Command) -> None:
    Path("run").mkdir()
    rows = [{"name": name, "pid": os.getpid(), "started": 1} for name in ("world", "zygote")]
    fleet = {"run": "small", "endpoint": "tcp/127.0.0.1:9", "processes": rows}
    Path("run/fleet.json").write_text(json.dumps(fleet))
    printed = qswarm("ps", "run")
    assert [line.split() for line in printed.out.splitlines()] == [
        ["name", "pid", "state"],
        ["world", str(os.getpid()), "gone"],
        ["zygote", str(os.getpid()), "gone"],
    ]
