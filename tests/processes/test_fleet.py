"""A launched fleet, intact and with failures: its output, its files, and no process left behind."""

import json
import os
import re
import signal
import sys
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from tests.processes.harness import QSWARM, Started, events_of, eventually, pids, rrd_verify
from worldsim.fleet.launcher import processes

pytestmark = pytest.mark.processes

Start = Callable[..., Started]
Write = Callable[[float], str]

EARLY_CTRL_C = """
from worldsim.commands.app import main
from worldsim.fleet import launcher

def ctrl_c(*_):
    raise KeyboardInterrupt

launcher.write_users = ctrl_c
main()
"""
AN_AGENT_NEVER_COMES = """
from worldsim.commands.app import main
from worldsim.fleet import fleet_monitor, process

def wait(startup, speed, should_stop, launcher_link):
    launcher_link.report_missing(["agent-3"])
    while not should_stop():
        launcher_link.wait(0.02)
    return False

fleet_monitor.REPORT_MISSING_EVERY_S = 0.1
process.assemble = wait
main()
"""
GARBAGE = """
from worldsim.commands.app import main
from worldsim.fleet import ipc, launcher_link

class Landing(ipc.Message, frozen=True):
    argument: object

def send_garbage(link, argument):
    link._launcher.send(Landing(str(argument)))

launcher_link.LaunchedLink.{report} = send_garbage
main()
"""
FAILING = """
from netem.free_running import FreeRunningMedium
from worldsim.commands.app import main
from worldsim.engine.step import SlotLoop

def fail(self, *given):
    raise LookupError("no such slot")

def play(self, truth, *given):
    return fail(self) if truth.slot >= 100 else netem(self, truth, *given)

def close(self, *given):
    return fail(self) if self.world.slot >= 100 else world(self, *given)

netem, world = FreeRunningMedium._play, SlotLoop.close
{patch}
main()
"""
FULL_FROM_THE_START = """
from pathlib import Path
from worldsim.commands.app import main

def full(draft, *_):
    raise OSError(28, "No space left on device")

Path.replace = full
main()
"""


@pytest.fixture
def run(tmp_path: Path) -> Path:
    return tmp_path / "run"


def launched(start: Start, scenario: str, run: Path, *options: str) -> Started:
    return start(*QSWARM, "run", scenario, "--out", str(run), *options)


def summary_of(run: Path) -> dict[str, Any]:
    summary: dict[str, Any] = json.loads((run / "summary.json").read_text())
    return summary


def none_left(of: dict[str, int]) -> None:
    eventually(lambda: not any(running(pid) for pid in of.values()), 5.0, lambda: str(of))


def running(pid: int) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] not in "ZX"
    except FileNotFoundError:
        return False


@pytest.mark.real_time
def test_a_run_passes_and_leaves_all_of_its_files(start: Start, scenario: Write, run: Path) -> None:
    fleet = launched(start, scenario(6.0), run, "--speed", "2")
    assert fleet.status(40.0) == 0, fleet.text

    summary = summary_of(run)
    assert (summary["outcome"], summary["mode"]) == ("pass", "processes")
    assert summary["duration_s"] == 6.0
    assert summary["real_time_factor"] > 1.0
    assert summary["packets"]["delivered"] > 0
    assert {event["agent"] for event in events_of(run) if event["kind"] == "slot"} == {0, 1, 2, 3}
    assert "  met  " in fleet.text
    from worldsim.recording.verify import verify  # noqa: PLC0415 - a second that other tests save

    verification = verify(run)
    assert (verification.whole, verification.differences) == (True, ()), verification
    assert rrd_verify(run / "run.rrd") == 0
    assert summary["invariants"]["I8"]["ticks"] > 6 * 20 / 2
    assert summary["delivery_late_ms"].keys() == {"median", "worst"}
    delivery = summary["delivery"]
    assert 0 < delivery["frames"] <= summary["packets"]["delivered"]
    assert delivery["frames"] == sum(each["frames"] for each in delivery["channels"].values())
    assert delivery["excess_ms"].keys() == {"p1", "p5", "p50", "p95", "p99", "max"}
    assert delivery["bound_ms"] == 62.5
    assert "extra delivery delay: " in fleet.text
    assert summary["overload"] == {"policy": "go", "least_speed": 2.0}
    resources = summary["resources"]
    assert resources["agent_steps"] == 4 * 6 * 20
    assert min(resources["cpu_us_per_agent_step"].values()) > 0.0
    assert 0.0 < resources["start_up_s"] < 30.0
    assert 0.5 < resources["agent_private_mb"] < 100.0
    assert [row.alive for row in processes(run)] == [False] * 7
    none_left(pids(run))


@pytest.mark.real_time
def test_a_killed_agent_is_reported_at_once_and_the_run_ends_with_a_verdict(
    start: Start, scenario: Write, run: Path
) -> None:
    fleet = launched(start, scenario(9.0), run, "--no-recording", "--speed", "2")
    fleet.wait_for_output("minimum separation")
    os.kill(pids(run)["agent-2"], signal.SIGKILL)
    fleet.wait_for_output(
        f"agent-2 (pid {pids(run)['agent-2']}) was killed by signal 9 at about", 1.0
    )
    assert " s (not scheduled); its vehicle stops and hovers\n" in fleet.text

    assert fleet.status(20.0) in (0, 1)
    kills = [event for event in events_of(run) if event["kind"] == "kill"]
    assert [(kill["agent"], kill["signal"], kill["planned"]) for kill in kills] == [(2, 9, False)]
    assert kills[0]["t_s"] < 9.0
    assert summary_of(run)["outcome"] in ("pass", "fail")


def test_ctrl_c_ends_everything_and_leaves_summary_and_recording(
    start: Start, scenario: Write, run: Path
) -> None:
    fleet = launched(start, scenario(60.0), run)
    fleet.wait_for_output("minimum separation")
    fleet.kill_group(signal.SIGINT)

    assert fleet.status(8.0) == 130, fleet.text
    summary = summary_of(run)
    assert summary["outcome"] == "inconclusive"
    assert "interrupted" in summary["reason"]
    assert 0.0 < summary["duration_s"] < 60.0
    assert recorded_ticks(run / "run.rrd") > 0
    assert rrd_verify(run / "run.rrd") == 0
    none_left(pids(run))


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGHUP])
def test_a_repeated_ctrl_c_does_not_cut_the_end_short(
    start: Start, scenario: Write, run: Path, number: signal.Signals
) -> None:
    fleet = launched(start, scenario(60.0), run, "--no-recording")
    fleet.wait_for_output("minimum separation")
    while fleet.process.poll() is None:
        fleet.kill_group(number)
        threading.Event().wait(0.02)

    assert fleet.status(8.0) == 130, fleet.text
    assert "inconclusive (interrupted after " in fleet.text
    assert summary_of(run)["reason"] in fleet.text
    assert not (run / "users").exists()
    none_left(pids(run))


def test_an_interrupt_before_the_world_is_started_leaves_scenario_and_logs(
    start: Start, scenario: Write, run: Path
) -> None:
    program = [sys.executable, "-c", EARLY_CTRL_C]
    fleet = start(*program, "run", scenario(60.0), "--out", str(run))
    assert fleet.status(8.0) == 130, fleet.text
    assert "Traceback" not in fleet.text
    assert sorted(file.name for file in run.iterdir()) == ["logs", "scenario.toml"]


def test_an_interrupt_before_take_off_is_reported_without_a_verdict(
    start: Start, scenario: Write, run: Path
) -> None:
    program = [sys.executable, "-c", AN_AGENT_NEVER_COMES]
    fleet = start(*program, "run", scenario(60.0), "--out", str(run))
    fleet.wait_for_output("still waiting for agent-3")
    fleet.kill_group(signal.SIGINT)
    assert fleet.status(8.0) == 130, fleet.text
    assert fleet.text.endswith(f"interrupted before take-off; logs in {run}/logs\n")
    assert "NOT MET" not in fleet.text
    assert "view it: " not in fleet.text
    assert sorted(file.name for file in run.glob("*.*")) == ["fleet.json", "scenario.toml"]
    assert "world: interrupted before take-off" in (run / "logs/world.log").read_text()


def test_a_disk_too_full_to_start_is_one_line_and_status_2(
    start: Start, scenario: Write, run: Path
) -> None:
    full = EARLY_CTRL_C.replace("KeyboardInterrupt", "OSError(28, 'No space left on device')")
    program = [sys.executable, "-c", full]
    fleet = start(*program, "run", scenario(60.0), "--out", str(run))
    assert fleet.status(8.0) == 2, fleet.text
    assert fleet.text.splitlines()[1:] == [f"{run}/users: no space left on device"]
    assert sorted(file.name for file in run.iterdir()) == ["logs", "scenario.toml"]


def test_a_disk_that_fills_up_during_the_start_ends_the_run_and_leaves_no_passwords(
    start: Start, scenario: Write, run: Path
) -> None:
    program = [sys.executable, "-c", FULL_FROM_THE_START]
    fleet = start(*program, "run", scenario(60.0), "--out", str(run))
    assert fleet.status(15.0) == 3, fleet.text
    assert fleet.text.splitlines()[1:] == [f"{run}/fleet.json: no space left on device"]
    assert not (run / "users").exists()
    assert not list(run.glob("*.part"))


def test_kill_9_of_the_launcher_leaves_no_process_and_a_summary(
    start: Start, scenario: Write, run: Path
) -> None:
    fleet = launched(start, scenario(60.0), run, "--no-recording")
    fleet.wait_for_output("minimum separation")
    started = pids(run)
    assert len(started) == 7
    fleet.process.kill()
    none_left(started)
    assert summary_of(run)["outcome"] == "inconclusive"
    assert not (run / "users").exists()


@pytest.mark.real_time
def test_a_stopped_netem_is_named_not_the_host(start: Start, scenario: Write, run: Path) -> None:
    fleet = launched(start, scenario(5.0), run, "--no-recording")
    fleet.wait_for_output("minimum separation")
    os.kill(pids(run)["netem"], signal.SIGSTOP)
    fleet.wait_for_output("netem was stopped by a signal at ", 5.0)
    # A stop that ends at once may leave the run sound: it lasts for two lines of progress.
    eventually(lambda: fleet.text.count("minimum separation") >= 3, 10.0, lambda: fleet.text)
    os.kill(pids(run)["netem"], signal.SIGCONT)
    assert fleet.status(20.0) in (1, 3), fleet.text
    assert "the host was too slow" not in fleet.text
    summary = summary_of(run)
    if summary["outcome"] == "inconclusive":
        assert summary["reason"].startswith("netem was stopped by a signal at ")


def test_the_death_of_netem_ends_the_run_with_a_message(
    start: Start, scenario: Write, run: Path
) -> None:
    fleet = launched(start, scenario(60.0), run)
    fleet.wait_for_output("minimum separation")
    os.kill(pids(run)["netem"], signal.SIGKILL)
    assert fleet.status(10.0) == 3
    assert re.search(
        r"^netem was killed by signal 9 at about \d+\.\d s; the run ends$", fleet.text, re.M
    )
    assert summary_of(run)["outcome"] == "inconclusive"
    assert summary_of(run)["reason"].startswith("netem was killed by signal 9 after ")
    none_left(pids(run))
    from worldsim.recording.verify import verify  # noqa: PLC0415 - a second that other tests save

    verification = verify(run)
    assert (verification.exit_status, verification.finished) == (3, True)


@pytest.mark.parametrize(
    ("patch", "reason"),
    [
        ("FreeRunningMedium._play = play", "netem ended with status 1: {} (logs/netem.log)"),
        ("SlotLoop.close = close", "the world failed: {} (logs/world.log)"),
    ],
)
def test_a_process_that_ends_by_its_own_error_is_named_with_the_error(
    start: Start, scenario: Write, run: Path, patch: str, reason: str
) -> None:
    program = [sys.executable, "-c", FAILING.format(patch=patch)]
    fleet = start(*program, "run", scenario(60.0), "--no-recording", "--out", str(run))
    assert fleet.status(20.0) == 3, fleet.text
    told = reason.format("LookupError: no such slot")
    assert summary_of(run)["reason"].startswith(f"{told} after ")
    assert told in " ".join(fleet.text.split())
    none_left(pids(run))


@pytest.mark.parametrize(
    ("report", "status", "begins"),
    [("report_missing", 2, "the fleet did not start: "), ("report_progress", 3, "")],
)
def test_garbage_from_the_world_ends_the_run_with_its_sender_and_leaves_no_process(
    start: Start, scenario: Write, run: Path, report: str, status: int, begins: str
) -> None:
    program = [sys.executable, "-c", GARBAGE.format(report=report)]
    options = ("--no-recording", "--out", str(run))
    fleet = start(*program, "run", scenario(60.0), *options)
    assert fleet.status(15.0) == status, fleet.text
    error = "world sent a message that cannot be decoded: Invalid value 'Landing'"
    assert f"\n{begins}{error}" in fleet.text
    assert "Traceback" not in fleet.text
    assert not (run / "users").exists()
    assert (run / "summary.json").exists() == (status == 3)
    if status == 3:
        assert summary_of(run)["reason"].startswith(error)
        none_left(pids(run))


def test_an_agent_that_does_not_start_is_named_with_the_end_of_its_log(
    start: Start, scenario: Write, run: Path, tmp_path: Path
) -> None:
    (tmp_path / "broken.py").write_text(
        "class Broken:\n"
        "    def __init__(self, setup):\n        raise OSError('no battery')\n"
        "    def decide(self, senses):\n        return None\n"
    )
    controller = 'control.controller="broken:Broken"'
    fleet = launched(start, scenario(6.0), run, "--no-recording", "--set", controller)
    assert fleet.status(20.0) == 2, fleet.text
    assert re.search(r"^agent-\d did not start: it ended with status 1; ", fleet.text, re.M)
    assert "no battery" in fleet.text
    assert sorted(each.name for each in run.iterdir()) == ["fleet.json", "logs", "scenario.toml"]
    none_left(pids(run))


def recorded_ticks(recording: Path) -> int:
    from rerun.chunk import RrdReader  # noqa: PLC0415 - a second that the other tests save

    chunks = RrdReader(recording).stream().filter(content="/world/agents", is_static=False)
    return sum(chunk.to_record_batch().num_rows for chunk in chunks)
