"""A fleet under a flood in the name of one of its agents: it does what it would without."""

import json
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.processes.harness import QSWARM, Started

pytestmark = pytest.mark.processes

Start = Callable[..., Started]
FLOODED = 10_000 * 5


def test_a_flood_in_an_agents_name_changes_nothing(
    start: Start, scenario: Callable[[float], str], tmp_path: Path
) -> None:
    run = tmp_path / "run"
    fleet = start(*QSWARM, "run", scenario(8.0), "--no-recording", "--out", str(run))
    fleet.says("in place")
    flood = start(sys.executable, "-m", "tests.processes.flooding", str(run), "1", "6.0")
    assert fleet.status(30.0) in (0, 3), fleet.text
    assert flood.status(15.0) == 0, flood.text

    summary = json.loads((run / "summary.json").read_text())
    refused = {who: sum(causes.values()) for who, causes in summary["rejected_by_cause"].items()}
    # What was flooded on two topics was read and refused, and the agent heard in between.
    assert refused["netem"] > FLOODED // 4, flood.text
    assert refused["world"] > FLOODED // 4, flood.text
    assert all(expectation["held"] for expectation in summary["expectations"])
    assert all(not each["violations"] for each in summary["invariants"].values())
    phase = summary["phases"][0]
    assert phase["converged"]
    assert phase["residual_m"] < 0.12
