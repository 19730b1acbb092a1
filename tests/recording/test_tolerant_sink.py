"""Killed processes and full disks: the recording ends early, and what it holds is readable."""

import os
import signal
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest

from tests.recording.flights import record, straight_flight, wedge
from worldsim.judge.run_events import Killed
from worldsim.recording.readback import read_run
from worldsim.recording.recorder import RunRecorder

DEADLINE_S = 60.0

KILLED = """
import os, signal, sys
from pathlib import Path
from tests.recording.flights import straight_flight, wedge
from worldsim.judge.verdict import Judge
from worldsim.recording.recorder import RunRecorder

scenario = wedge(9, duration_s=4.0)
recorder = RunRecorder(Path(sys.argv[1]), scenario, "killed", mode="virtual")
judge = Judge(scenario)
for tick in straight_flight(scenario):
    recorder.tick(tick, judge.see(tick))
    if tick.index == 70:
        os.kill(os.getpid(), signal.SIGKILL)
"""

FULL = """
import resource, sys
from pathlib import Path
from tests.recording.flights import record, straight_flight, wedge
from worldsim.recording.recorder import RunRecorder

resource.setrlimit(resource.RLIMIT_FSIZE, (700_000, 700_000))
scenario = wedge(30, duration_s=8.0)
recorder = RunRecorder(Path(sys.argv[1]), scenario, "full", mode="virtual")
judge = record(recorder, scenario, list(straight_flight(scenario)))
print(judge.ticks)
"""


def run(code: str, path: Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-c", code, str(path)],
        capture_output=True,
        text=True,
        timeout=DEADLINE_S,
        check=False,
    )


def test_a_killed_process_loses_the_last_second_at_most(tmp_path: Path) -> None:
    path = tmp_path / "run.rrd"
    assert run(KILLED, path).returncode == -signal.SIGKILL
    assert [tick.index for tick in read_run(path).ticks][:41] == list(range(41))
    assert len(read_run(path).ticks) in {40, 60}


def test_a_full_disk_is_reported_once_and_the_run_ends_cleanly(tmp_path: Path) -> None:
    path = tmp_path / "run.rrd"
    ended = run(FULL, path)
    assert ended.returncode == 0
    assert ended.stdout == "161\n"
    assert ended.stderr.count("recording: ") == 1
    assert "run.rrd ends here, the run continues: File too large" in ended.stderr
    assert read_run(path).ticks


def test_a_full_disk_that_holds_stderr_too_does_not_end_the_run(tmp_path: Path) -> None:
    ended = run(f"import sys; sys.stderr = open('/dev/full', 'w')\n{FULL}", tmp_path / "run.rrd")
    assert ended.stdout == "161\n"


@pytest.mark.parametrize("kept", [0.5, 0.75, 0.9, 0.999, 1.0])
def test_a_truncated_file_is_read_as_far_as_it_goes(tmp_path: Path, kept: float) -> None:
    path = tmp_path / "run.rrd"
    scenario = wedge(9, duration_s=6.0)
    ticks = list(straight_flight(scenario))
    record(RunRecorder(path, scenario, "cut", mode="virtual"), scenario, ticks)
    os.truncate(path, int(path.stat().st_size * kept) - 1)
    readback = read_run(path)
    assert 20 <= len(readback.ticks) <= len(ticks)
    for before, after in zip(ticks, readback.ticks, strict=False):
        assert after.position.tobytes() == before.position.tobytes()


def test_a_recording_that_cannot_be_created_does_not_end_the_run(tmp_path: Path) -> None:
    reports: list[str] = []
    scenario = wedge(4, duration_s=3.0)
    recorder = RunRecorder(
        tmp_path / "no" / "run.rrd", scenario, "none", report=reports.append, mode="virtual"
    )
    recorder.event(Killed(t_s=0.0, agent=0, planned=True))
    judge = record(recorder, scenario, list(straight_flight(scenario)))
    assert judge.ticks == 61
    assert len(reports) == 1
    assert "No such file" in reports[0]


def test_an_earlier_recording_is_not_overwritten(tmp_path: Path) -> None:
    path = tmp_path / "run.rrd"
    path.write_text("precious")
    reports: list[str] = []
    RunRecorder(path, wedge(4), "second", report=reports.append, mode="virtual").close()
    assert path.read_text() == "precious"
    assert len(reports) == 1


def test_rows_of_a_wrong_shape_end_the_recording_not_the_run(tmp_path: Path) -> None:
    reports: list[str] = []
    scenario = wedge(4, duration_s=3.0)
    ticks = list(straight_flight(scenario))
    ticks[30] = replace(ticks[30], target=ticks[30].target[:2])
    path = tmp_path / "run.rrd"
    recorder = RunRecorder(path, scenario, "odd", mode="virtual", report=reports.append)
    assert record(recorder, scenario, ticks).ticks == 61
    assert len(reports) == 1
    assert [tick.index for tick in read_run(path).ticks] == list(range(20))
