"""What the commands that run scenarios print and write: --quiet, --json and --junit."""

import json
import os
import subprocess
from pathlib import Path
from xml.etree import ElementTree as ET

import pytest

from tests.commands.conftest import Command
from tests.processes.harness import QSWARM

BROKEN = """
class Broken:
    def __init__(self, setup):
        pass

    def decide(self, senses):
        raise ValueError("lost")
"""
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
    command += ["--junit", "made.xml"]
    made = subprocess.run(
        [*command, "--duration", "1", "--out", "one"], capture_output=True, text=True, check=False
    )
    document = json.loads(made.stdout)
    assert made.returncode == 1  # one second is too short to converge
    assert (document["mode"], document["outcome"]) == ("lockstep", "fail")
    assert "starting netem" in made.stderr
    assert cases("made.xml")["small.1", "outcome"] == ["failure", "system-out"]


def cases(file: str) -> dict[tuple[str | None, str | None], list[str]]:
    """Return what each case of a JUnit file holds."""
    root = ET.parse(file).getroot()
    return {
        (case.get("classname"), case.get("name")): [each.tag for each in case]
        for case in root.iter("testcase")
    }


def test_junit_has_the_cases_of_each_seed(small: Path, qswarm: Command) -> None:
    many = ("--seeds", "0:2", "--out", "many", "--junit", "many/made.xml")
    assert qswarm("sim", small, "--no-recording", *many, *LATE).status == 1
    made = cases("many/made.xml")
    for seed in (0, 1):
        assert made[f"small.{seed}", "outcome"] == ["failure", "system-out"]
        assert made[f"small.{seed}", "converge line"] == ["failure"]
        assert made[f"small.{seed}", "min_separation_m"] == []


def test_a_controller_that_fails_is_an_error_in_the_junit_file(
    small: Path, qswarm: Command, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.syspath_prepend(small.parent)
    small.with_name("broken.py").write_text(BROKEN)
    mine = ("--set", "control.controller=broken:Broken", "--junit", "made.xml")
    printed = qswarm("sim", small, "--no-recording", "--json", *mine)
    assert (printed.status, printed.out) == (1, "")
    assert cases("made.xml") == {("small.1", "outcome"): ["error", "system-out"]}


@pytest.mark.parametrize("command", ["sim", "run"])
def test_a_junit_file_that_cannot_be_written_is_refused_before_the_flight(
    small: Path, qswarm: Command, command: str
) -> None:
    printed = qswarm(command, small, "--junit", "none/made.xml", "--out", "one")
    assert printed == (2, "", "none/made.xml: no such file or directory\n")
    assert not Path("one").exists()


def test_a_junit_file_that_is_lost_is_no_pass(small: Path, qswarm: Command) -> None:
    printed = qswarm("sim", small, "--no-recording", "--quiet", "--junit", "/dev/full")
    assert (printed.status, printed.err) == (3, "/dev/full: no space left on device\n")
    printed = qswarm("sim", small, "--no-recording", "--quiet", "--junit", "/dev/full", *LATE)
    assert printed.status == 1


def test_a_terminal_gets_a_table(small: Path) -> None:
    master, terminal = os.openpty()
    command = [*QSWARM, "sim", os.fspath(small), "--no-recording", "--out", "one"]
    made = subprocess.run(command, stdout=terminal, stderr=subprocess.PIPE, check=False)
    os.close(terminal)
    shown = os.read(master, 65536).decode()
    os.close(master)
    assert (made.returncode, made.stderr) == (0, b"")
    assert "required" in shown.splitlines()[2]
    assert "pass  one/summary.json" in shown
