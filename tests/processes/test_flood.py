"""A fleet under a flood of forged messages of one of its agents: it behaves as without."""

import json
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.processes.harness import QSWARM, Started, pids

pytestmark = [pytest.mark.processes, pytest.mark.real_time]

Start = Callable[..., Started]
FLOODED = 3 * 10_000 * 5
INTRUDERS = """
[[event]]
at_s = 1.0
for_s = 6.0
intruder = { agents = [1] }
[[event]]
at_s = 2.0
intruder = { per_s = 50 }
"""


def test_a_flood_of_an_agents_messages_does_not_disturb_the_fleet(
    start: Start, scenario: Callable[[float], str], tmp_path: Path
) -> None:
    run, file = tmp_path / "run", Path(scenario(8.0))
    file.write_text(file.read_text() + INTRUDERS)
    fleet = start(*QSWARM, "run", str(file), "--no-recording", "--out", str(run))
    assert fleet.status(30.0) in (0, 3), fleet.text
    assert not any(Path(f"/proc/{pids(run)[name]}").exists() for name in ("intruder-0", "world"))

    summary = json.loads((run / "summary.json").read_text())
    rejected = {
        process: sum(causes.values()) for process, causes in summary["rejected_by_cause"].items()
    }
    flood, noise = summary["faults"]
    assert flood["messages"] > FLOODED // 2
    assert (flood["to_s"], noise["to_s"], noise["agents"]) == (7.0, None, [])
    assert noise["messages"] > 100
    # The flood on two topics was read and rejected, and the agent was still heard.
    assert rejected["netem"] > FLOODED // 12
    assert rejected["world"] > FLOODED // 12
    assert all(expectation["held"] for expectation in summary["expectations"])
    assert all(not each["violations"] for each in summary["invariants"].values())
    phase = summary["phases"][0]
    assert phase["converged"]
    assert phase["residual_m"] < 0.12
