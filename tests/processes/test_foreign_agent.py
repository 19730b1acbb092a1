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


OF_AN_OLDER_WIRE = """import sys
sys.path.insert(0, {examples!r})
import foreign_agent
payload_of = foreign_agent.payload_of
foreign_agent.payload_of = lambda fields: payload_of(fields[:-4])
foreign_agent.main()
"""


def test_one_that_nobody_understands_fails_the_run(start: Start, tmp_path: Path) -> None:
    program, run = tmp_path / "older.py", tmp_path / "run"
    program.write_text(OF_AN_OLDER_WIRE.format(examples=str(EXAMPLES)))
    keys = ("--agents", "3", "--duration", "1.5", "--set", "expect.converge=false")
    agent = f"agent=[{{ ids = [2], command = {[sys.executable, str(program)]} }}]"
    scenario = (str(EXAMPLES / "foreign-9.toml"), "--set", agent)
    spoofed = "event=[{ at_s = 0, for_s = 1, sabotage = { kind = 'spoof', agents = [0, 1] } }]"
    said = (*keys, "--set", spoofed, "--lockstep", "--no-recording", "--out", str(run))
    fleet = start(*QSWARM, "run", *scenario, *said)
    assert fleet.status(60.0) == 1, fleet.text
    why = "agent 2 takes no part: whoever hears it rejects all of its frames (30 invalid"
    assert f"fail ({why}" in fleet.text
    (row,) = json.loads((run / "summary.json").read_text())["refused"]
    assert (row["agent"], row["accepted"], row["rejected"]) == (2, 0, {"invalid": 30})


@pytest.mark.real_time
def test_it_flies_on_the_wall_clock(start: Start, tmp_path: Path) -> None:
    run = tmp_path / "run"
    assert flown(launched(start, run, OF_THE_PAGE), run)["mode"] == "processes"


def test_one_that_does_not_start_is_named_with_its_last_line(start: Start, tmp_path: Path) -> None:
    fleet = launched(start, tmp_path / "run", ["sh", "-c", "echo no wind >&2; exit 3"])
    assert fleet.status(40.0) == 2, fleet.text
    assert "agent-8 did not start: it ended with status 3;" in fleet.text
    assert fleet.text.splitlines()[-1].strip() == "no wind"
