"""Controllers other than the Q-structure, in fleets of real processes."""

import json
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.processes.harness import QSWARM, Started

pytestmark = pytest.mark.processes

Start = Callable[..., Started]

FLOCKING = str(Path(__file__).parents[2] / "deploy" / "scenarios" / "flocking-9.toml")
FAILS = """
from agent.guidance.flocking import Flocking


class Fails(Flocking):
    def __init__(self, setup):
        super().__init__(setup)
        self._id = setup.id

    def decide(self, senses):
        if self._id == 2 and senses.now_s > 1.0:
            raise LookupError("no wind")
        return super().decide(senses)
"""


def launched(start: Start, run: Path, *options: str) -> Started:
    return start(*QSWARM, "run", FLOCKING, "--no-recording", "--out", str(run), *options)


def test_a_flock_of_processes_keeps_its_separation(start: Start, tmp_path: Path) -> None:
    run = tmp_path / "run"
    fleet = launched(start, run, "--duration", "6", "--speed", "2")
    assert fleet.status(40.0) == 0, fleet.text
    summary = json.loads((run / "summary.json").read_text())
    assert (summary["outcome"], summary["mode"]) == ("pass", "processes")
    assert [row["name"] for row in summary["expectations"]] == ["min_separation_m"]
    assert summary["min_separation_m"] >= 0.25


def test_a_failing_controller_is_named_and_its_vehicle_hovers(start: Start, tmp_path: Path) -> None:
    (tmp_path / "weak.py").write_text(FAILS)
    run = tmp_path / "run"
    fleet = launched(start, run, "--duration", "3", "--set", "control.controller=weak:Fails")
    assert fleet.status(40.0) == 0, fleet.text
    assert "controller 'weak:Fails' of agent 2 failed at 1.0" in fleet.text
    assert "LookupError: no wind" in fleet.text
    assert "(not scheduled); its vehicle stops and hovers" in fleet.text
    kills = [json.loads(line) for line in (run / "events.jsonl").read_text().splitlines()]
    assert [(kill["kind"], kill["agent"], kill["status"]) for kill in kills] == [("kill", 2, 1)]
