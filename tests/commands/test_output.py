"""What the commands that run scenarios print: one line with --quiet, one document with --json."""

import json
import os
import subprocess
from pathlib import Path

import pytest

from tests.commands.conftest import Command
from tests.processes.harness import QSWARM

LATE = ("--set", "expect.converge_within_s=0.01")


def test_quiet_leaves_the_outcome(small: Path, qswarm: Command) -> None:
    printed = qswarm("sim", small, "--no-recording", "--quiet", "--out", "one")
    assert printed == (0, "pass  one/summary.json\n", "")


def test_quiet_names_the_runs_that_did_not_pass(small: Path, qswarm: Command) -> None:
    hard = small.with_name("hard.toml")
    hard.write_text(small.read_text().replace('"small"', '"hard"'))
    hard.write_text(hard.read_text() + "[expect]\nconverge_within_s = 0.01\n")
    printed = qswarm("sim", small, hard, "--no-recording", "--quiet", "--out", "two")
    failed, outcome = printed.out.splitlines()
    assert (printed.status, printed.err) == (1, "")
    assert failed.startswith("fail (line: converged in ")
    assert failed.endswith("  two/hard-seed1")
    assert outcome == "fail  two/summary.json"


@pytest.mark.parametrize(("more", "status"), [((), 0), (LATE, 1)])
def test_json_is_the_summary_and_words_go_to_stderr(
    small: Path, qswarm: Command, more: tuple[str, ...], status: int
) -> None:
    printed = qswarm("sim", small, "--no-recording", "--json", "--out", "one", *more)
    assert printed.status == status
    assert printed.out == Path("one/summary.json").read_text()
    assert printed.err.splitlines()[-1].endswith("  one/summary.json")
    assert "minimum separation" in printed.err


def test_json_of_many_runs_is_one_document(small: Path, qswarm: Command) -> None:
    printed = qswarm("sim", small, "--no-recording", "--json", "--quiet", "--seeds", "0:2")
    document = json.loads(printed.out)
    assert (document["runs"], document["outcome"], printed.err) == (2, "pass", "")
    assert [row["seed"] for row in document["rows"]] == [0, 1]


@pytest.mark.parametrize("option", ["--json", "--quiet"])
def test_bad_input_leaves_stdout_empty(small: Path, qswarm: Command, option: str) -> None:
    printed = qswarm("sim", small, option, "--set", "fleet.agents=none")
    assert (printed.status, printed.out) == (2, "")
    assert len(printed.err.splitlines()) == 1


def test_json_of_processes_goes_through_a_pipe(small: Path) -> None:
    command = [*QSWARM, "run", os.fspath(small), "--lockstep", "--json", "--no-recording"]
    made = subprocess.run(
        [*command, "--duration", "1", "--out", "one"], capture_output=True, text=True, check=False
    )
    document = json.loads(made.stdout)
    assert made.returncode == 1  # one second is too short to converge
    assert (document["mode"], document["outcome"]) == ("lockstep", "fail")
    assert "starting netem" in made.stderr
