"""A fleet under a flood of forged messages of one of its agents: it behaves as without."""

import json
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.processes.harness import QSWARM, Started

pytestmark = [pytest.mark.processes, pytest.mark.real_time]

Start = Callable[..., Started]
FLOODED = 10_000 * 5


def test_a_flood_of_an_agents_messages_does_not_disturb_the_fleet(
    start: Start, scenario: Callable[[float], str], tmp_path: Path
) -> None:
    run = tmp_path / "run"
    fleet = start(*QSWARM, "run", scenario(8.0), "--no-recording", "--out", str(run))
    fleet.wait_for_output("least separation")
    flood = start(sys.executable, "-m", "tests.processes.flooding", str(run), "1", "6.0")
    assert fleet.status(30.0) in (0, 3), fleet.text
    assert flood.status(15.0) == 0, flood.text

    summary = json.loads((run / "summary.json").read_text())
    rejected = {
        process: sum(causes.values()) for process, causes in summary["rejected_by_cause"].items()
    }
    # The flood on two topics was read and rejected, and the agent was still heard.
    assert rejected["netem"] > FLOODED // 4, flood.text
    assert rejected["world"] > FLOODED // 4, flood.text
    assert all(expectation["held"] for expectation in summary["expectations"])
    assert all(not each["violations"] for each in summary["invariants"].values())
    phase = summary["phases"][0]
    assert phase["converged"]
    assert phase["residual_m"] < 0.12
