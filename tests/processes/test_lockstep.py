"""Lockstep: real processes give the run of virtual time; an unexpected exit ends the run."""

import json
import os
import signal
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from tests.processes.harness import QSWARM, Started, events_of, eventually, pids, rrd_verify
from worldsim.engine.virtual import fly
from worldsim.scenario.file import load

pytestmark = pytest.mark.processes

Start = Callable[..., Started]
Write = Callable[[float], str]

ROUGH = """
jitter_ms = 30
distribution = "pareto"
loss_percent = 5
duplicate_percent = 2
corrupt_percent = 1
rate_kbit = 128
gemodel = { p_percent = 5, r_percent = 25, loss_bad_percent = 90 }
"""
EVENTS = """
[[event]]
at_s = 1.0
pause = [3]
for_s = 3.0
[[event]]
at_s = 1.5
kill = [1, "random:1"]
for_s = 1.0
[[event]]
at_s = 2.0
partition = [[0, 3]]
for_s = 1.0
[[event]]
at_s = 3.0
join = { count = 1, start = { kind = "list", positions_m = [[-4.2, 0.3, 0]] } }
[[event]]
at_s = 4.0
netem = { loss_percent = 60 }
[[event]]
at_s = 4.5
leave = [2]
[[event]]
at_s = 0.8
for_s = 2.5
slow = { agents = [0, 1, 3], delay_s = 0.13 }
[[event]]
at_s = 1.0
for_s = 3.0
slow = { agents = ["random:1"], delay_s = 0.02 }
[[event]]
at_s = 2.2
for_s = 3.0
starve = { agents = [0, 2, 3], cpu_percent = 30, period_s = 0.4 }
[[event]]
at_s = 3.2
for_s = 1.0
clock = { agents = [0, 2], offset_s = 0.4, drift_ppm = 1000 }
[[event]]
at_s = 1.2
for_s = 3.0
pose = { agents = [1, 2], bias_m = [0.2, 0, 0.1], noise_m = 0.05, bias_yaw_deg = 20 }
[[event]]
at_s = 0.5
sabotage = { kind = "garbage", agents = ["random:1", 3] }
for_s = 3.0
[[event]]
at_s = 1.0
sabotage = { kind = "replay", agents = [0], delay_s = 0.7 }
[[event]]
at_s = 3.5
sabotage = { kind = "spoof", agents = ["vertex:V1"] }
[[event]]
at_s = 2.25
kill = ["netem"]
for_s = 0.5
[[event]]
at_s = 5.1
pause = ["netem"]
for_s = 0.3
[[event]]
at_s = 5.5
pause = ["world"]
for_s = 0.2
"""


@pytest.fixture
def run(tmp_path: Path) -> Path:
    return tmp_path / "run"


@pytest.fixture
def rough(scenario: Write) -> Write:
    def write(duration_s: float) -> str:
        path = Path(scenario(duration_s))
        clean = path.read_text().replace("agents = 4", "agents = 4\nboot_s = 0.5\nbriefed = [0]")
        path.write_text(clean.replace("delay_ms = 10", "delay_ms = 10" + ROUGH) + EVENTS)
        return str(path)

    return write


def lockstep(start: Start, scenario: str, run: Path, *options: str) -> Started:
    return start(*QSWARM, "run", scenario, "--lockstep", "--out", str(run), *options)


def summary_of(run: Path) -> dict[str, Any]:
    summary: dict[str, Any] = json.loads((run / "summary.json").read_text())
    return summary


def test_a_clean_run_equals_virtual_time_and_passes(
    start: Start, scenario: Write, run: Path
) -> None:
    fleet = lockstep(start, scenario(6.0), run)
    assert fleet.status(40.0) == 0, fleet.text
    summary, flight = summary_of(run), fly(load(Path(scenario(6.0))))
    assert (summary["mode"], summary["outcome"]) == ("lockstep", "pass")
    assert summary["trace_sha256"] == flight.loop.trace.sha256
    assert summary["late_tick_fraction"] is None
    assert summary["real_time_factor"] > 0.0
    assert summary["packets"]["delivered"] == flight.medium_counters.fates["delivered"]
    from worldsim.recording.verify import verify  # noqa: PLC0415 - a second that other tests save

    verification = verify(run)
    assert (verification.whole, verification.differences) == (True, ()), verification
    assert rrd_verify(run / "run.rrd") == 0


@pytest.mark.parametrize("shards", [1, 3])
def test_a_run_with_faults_equals_virtual_time(
    start: Start, rough: Write, run: Path, shards: int
) -> None:
    fleet = lockstep(start, rough(6.0), run, "--no-recording", "--shards", str(shards))
    assert fleet.status(60.0) in (1, 3), fleet.text  # six seconds are too short to form
    summary, flight = summary_of(run), fly(load(Path(rough(6.0))))
    assert summary["duration_s"] == 6.0, summary["reason"]
    assert summary["trace_sha256"] == flight.loop.trace.sha256
    packets = flight.medium_counters.packets()
    assert {name: summary["packets"][name] for name in packets} == packets
    frames = {row["number"]: row["frames"] for row in summary["faults"] if row["frames"]}
    assert frames == dict(flight.medium_counters.struck) != {}
    assert {each.partition("-")[2] for each in pids(run) if each.startswith("netem-")} == {
        str(shard) for shard in range(1, shards)
    }
    kinds = [event["kind"] for event in events_of(run)]
    assert kinds == [event.kind for event in flight.loop.events]


def test_an_agent_that_dies_ends_the_run_with_a_message(
    start: Start, scenario: Write, run: Path
) -> None:
    fleet = lockstep(start, scenario(3000.0), run, "--no-recording")
    fleet.wait_for_output("minimum separation")
    os.kill(pids(run)["agent-2"], signal.SIGKILL)
    assert fleet.status(15.0) == 1
    assert "agent-2 was killed by signal 9, " in summary_of(run)["reason"]
    assert " s (not scheduled); the run ends\n" in fleet.text
    assert "fail (agent-2 was killed by signal 9" in fleet.text


def test_a_medium_that_dies_ends_the_run_with_a_message(
    start: Start, scenario: Write, run: Path
) -> None:
    fleet = lockstep(start, scenario(3000.0), run, "--no-recording", "--shards", "2")
    fleet.wait_for_output("minimum separation")
    os.kill(pids(run)["netem-1"], signal.SIGKILL)
    assert fleet.status(15.0) == 1
    assert summary_of(run)["reason"] == "netem-1 was killed by signal 9"


@pytest.mark.parametrize(
    ("stopped", "awaited"), [("agent-2", "agent-2's command of slot"), ("netem", "")]
)
def test_a_stalled_run_reports_once_what_it_waits_for(
    start: Start, scenario: Write, run: Path, stopped: str, awaited: str
) -> None:
    fleet = lockstep(start, scenario(3000.0), run, "--no-recording")
    fleet.wait_for_output("minimum separation")
    pid = pids(run)[stopped]
    os.kill(pid, signal.SIGSTOP)
    fleet.wait_for_output(f"stalled: waiting for {awaited}", within_s=10.0)
    fleet.wait_for_output(f"; stopped: {stopped}\n")
    os.kill(pid, signal.SIGCONT)
    reports = fleet.text.count(" of 3000 s")
    eventually(lambda: fleet.text.count(" of 3000 s") > reports, 10.0)
    fleet.kill_group(signal.SIGINT)
    assert fleet.status(10.0) == 130, fleet.text
    assert fleet.text.count("stalled: ") == 1


def test_ctrl_c_ends_a_lockstep_run(start: Start, scenario: Write, run: Path) -> None:
    fleet = lockstep(start, scenario(3000.0), run, "--no-recording")
    fleet.wait_for_output("minimum separation")
    fleet.kill_group(signal.SIGINT)
    assert fleet.status(10.0) == 130, fleet.text
    assert summary_of(run)["outcome"] == "inconclusive"


def test_contradicting_options_are_one_line(start: Start, scenario: Write, run: Path) -> None:
    fast = lockstep(start, scenario(6.0), run, "--speed", "2")
    assert fast.status(10.0) == 2
    assert "--speed: cannot be combined with --lockstep" in fast.text
    sharded = start(*QSWARM, "run", scenario(6.0), "--shards", "2", "--out", str(run))
    assert sharded.status(10.0) == 2
    assert "--shards: needs --lockstep" in sharded.text
    assert not run.exists()
