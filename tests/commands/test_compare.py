"""compare: two runs, two folders of many, and what cannot be compared."""

import json
from pathlib import Path

from tests.commands.conftest import Command


def test_many_runs_are_compared_and_a_mix_is_refused(small: Path, qswarm: Command) -> None:
    short = ("--no-recording", "--duration", "2", "--quiet")
    qswarm("sim", small, *short, "--seeds", "0:2", "--out", "many")
    qswarm("sim", small, *short, "--seed", "0", "--out", "one")
    printed = qswarm("compare", "many", "many", "--json")
    assert printed.status == 0
    (cell,) = json.loads(printed.out)["cells"]
    assert (cell["settings"], cell["same_traces"]) == ({"scenario": "small"}, 2)
    same = qswarm("compare", "one", "many/small-seed0")
    assert same.out.splitlines()[-1].startswith("traces: equal")
    other = qswarm("compare", "one", "many/small-seed1").out
    assert "  seed  0  1" in other
    mixed = qswarm("compare", "many", "one")
    assert (mixed.status, mixed.out) == (2, "")
    assert mixed.err == "one: holds one run, and many holds many runs: compare two of a kind\n"
    missing = qswarm("compare", "many", "none")
    assert (missing.status, missing.err) == (2, "none: no such folder\n")
