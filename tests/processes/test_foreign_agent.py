"""A foreign agent among eight of ours: it converges, and repeats itself in lockstep."""

import json
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from tests.processes.harness import QSWARM, Started

pytestmark = pytest.mark.processes

Start = Callable[..., Started]
OF_THE_PAGE = [sys.executable, "foreign_agent.py"]
EXAMPLES = Path(__file__).parents[2] / "docs" / "examples"


def launched(start: Start, run: Path, command: list[str], *options: str) -> Started:
    agent = f"agent=[{{ ids = [8], command = {command} }}]"
    scenario = str(EXAMPLES / "foreign-9.toml")
    keys = ("--set", agent, "--set", "expect.converge_within_s=5", "--duration", "7")
    return start(*QSWARM, "run", scenario, "--out", str(run), "--no-recording", *keys, *options)


def flown(fleet: Started, run: Path) -> dict[str, Any]:
    """Return the summary of a fleet with the foreign agent of the page, once it has passed."""
    assert fleet.status(60.0) == 0, fleet.text
    summary: dict[str, Any] = json.loads((run / "summary.json").read_text())
    assert summary["phases"][0]["converged"]
    assert (run / "logs" / "agent-8.log").read_text() == "agent-8 flies in run 'foreign-9'\n"
    return summary


def test_it_flies_the_same_twice_in_lockstep(start: Start, tmp_path: Path) -> None:
    runs = [tmp_path / "first", tmp_path / "second"]
    fleets = [launched(start, run, OF_THE_PAGE, "--lockstep") for run in runs]
    first, second = map(flown, fleets, runs)
    assert first["trace_sha256"] == second["trace_sha256"] is not None


@pytest.mark.real_time
def test_it_flies_on_the_wall_clock(start: Start, tmp_path: Path) -> None:
    run = tmp_path / "run"
    assert flown(launched(start, run, OF_THE_PAGE), run)["mode"] == "processes"


def test_one_that_does_not_start_is_named_with_its_last_line(start: Start, tmp_path: Path) -> None:
    fleet = launched(start, tmp_path / "run", ["sh", "-c", "echo no wind >&2; exit 3"])
    assert fleet.status(40.0) == 2, fleet.text
    assert "agent-8 did not start: it ended with status 3;" in fleet.text
    assert fleet.text.splitlines()[-1].strip() == "no wind"
