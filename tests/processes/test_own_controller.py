"""Controllers other than the Q-structure, in fleets of real processes."""

import json
import re
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from tests.processes.harness import QSWARM, Started
from tests.tutorial.meeting import assert_agreed, save_files, trace_of

pytestmark = [pytest.mark.processes, pytest.mark.real_time]

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


@pytest.fixture(autouse=True)
def in_pure_python(monkeypatch: pytest.MonkeyPatch) -> None:
    """Have the fleets run pure: these controllers derive from one that may be compiled."""
    monkeypatch.setenv("QSWARM_PURE", "1")


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
    assert fleet.status(40.0) == 1, fleet.text
    assert re.search(
        r"fail \(agent-2 ended with status 1 at 1\.\d s: .*no wind \(logs/agent-2\.log\)\)",
        " ".join(fleet.text.split()),
    )
    assert "controller 'weak:Fails' of agent 2 failed at 1.0" in fleet.text
    assert "LookupError: no wind" in fleet.text
    assert "(not scheduled); its vehicle stops and hovers" in fleet.text
    kills = [json.loads(line) for line in (run / "events.jsonl").read_text().splitlines()]
    assert [(kill["kind"], kill["agent"], kill["status"]) for kill in kills] == [("kill", 2, 1)]


def test_controllers_agree_in_their_own_words_under_each_clock(
    start: Start, tmp_path: Path
) -> None:
    save_files(tmp_path)
    meeting = str(tmp_path / "meeting.toml")
    flights = {
        "virtual": ("sim", "--duration", "4"),
        "lockstep": ("run", "--lockstep", "--duration", "4"),
        "processes": ("run", "--duration", "5", "--record-inputs"),
    }
    for name, (kind, *options) in flights.items():
        run = tmp_path / name
        fleet = start(*QSWARM, kind, meeting, "--out", str(run), *options)
        assert fleet.status(40.0) == 0, fleet.text
        assert_agreed(run)
    assert trace_of(tmp_path / "lockstep") == trace_of(tmp_path / "virtual")
    free = tmp_path / "processes"
    assert "knows of 9" in (free / "logs" / "agent-4.log").read_text()
    asked = start(*QSWARM, "replay", str(free), "--agent", "4", "--from", "4")
    assert asked.status(20.0) == 0, asked.text
    assert "known = 9\n" in asked.text
    assert "agent 4 decides as in the run, at " in asked.text
    assert "since" not in asked.text


SLOW = """
import time
from agent.guidance.flocking import Flocking


class Slow(Flocking):
    def decide(self, senses):
        time.sleep(0.1)
        return super().decide(senses)
"""


def test_an_overload_ends_the_run_in_order(start: Start, tmp_path: Path) -> None:
    (tmp_path / "slow.py").write_text(SLOW)
    run = tmp_path / "run"
    slow = ("--set", "control.controller=slow:Slow", "--on-overload", "abort")
    fleet = start(*QSWARM, "run", FLOCKING, "--out", str(run), *slow)
    assert fleet.status(40.0) == 3, fleet.text
    assert " % of the ticks in the last 2 s; the run ends (--on-overload abort); use " in fleet.text
    summary = json.loads((run / "summary.json").read_text())
    assert summary["outcome"] == "inconclusive"
    assert summary["reason"].startswith("the controllers of agent-0, ")
    assert " ms a step: overload (late: " in summary["reason"]
    assert summary["overload"]["policy"] == "abort"
    assert 0.0 < summary["duration_s"] < 10.0
    from worldsim.recording.verify import verify  # noqa: PLC0415 - a second that other tests save

    recorded = verify(run)
    assert abs(recorded.ticks - 20.0 * summary["duration_s"]) <= 1.0
    assert recorded.inconclusive == f"summary.json: {summary['reason']}"
    assert not list(processes_of(fleet.process.pid))


MIXED = """
import os, signal, time
from agent.guidance.flocking import Flocking


class Mixed(Flocking):
    def __init__(self, setup):
        super().__init__(setup)
        self._id = setup.id
        self._begun = False

    def decide(self, senses):
        if senses.now_s > 1.0 and not self._begun:
            self._begun = True
            self._misbehave()
        return super().decide(senses)

    def _misbehave(self):
        match self._id:
            case 0:
                print("x" * 3_000_000)
            case 1:
                os._exit(0)
            case 2:
                time.sleep(1e6)
            case 3:
                os.closerange(0, 200)
            case 4:
                signal.signal(signal.SIGTERM, signal.SIG_IGN)
                if os.fork() == 0:
                    time.sleep(600)
            case 5:
                os.posix_spawn("/bin/sleep", ["sleep", "600"], {})
            case 6:
                os.fork()
            case 7:
                hoard = []
                while True:
                    hoard.append(bytes(100_000_000))
"""
"""Eight ways to misbehave, one for each agent but the last."""


def test_controllers_that_misbehave_are_named_bounded_and_ended(
    start: Start, tmp_path: Path
) -> None:
    (tmp_path / "mixed.py").write_text(MIXED)
    run = tmp_path / "run"
    fleet = launched(start, run, "--duration", "4", "--set", "control.controller=mixed:Mixed")
    assert fleet.status(60.0) == 1, fleet.text
    reason = json.loads((run / "summary.json").read_text())["reason"]
    assert "agent-1 ended with status 0 at 1." in reason
    assert "agent-3 ended with status 5 at 1." in reason
    assert "agent-7 ended with status 1 at " in reason
    assert "the controller of agent-2 has not returned since 1." in reason
    assert "agent-3: its controller closed the files of its process" in fleet.text
    assert "of agent 7 failed at 1." in fleet.text
    for still_flies in ("agent-0", "agent-5", "agent-6", "agent-8", "the host"):
        assert still_flies not in reason
    assert (run / "logs/agent-0.log").stat().st_size < 1_200_000
    assert not list(processes_of(fleet.process.pid))


def processes_of(session: int) -> Iterator[str]:
    """Yield the live processes of a session, those that were left behind too."""
    for stat in Path("/proc").glob("[0-9]*/stat"):
        try:
            state, _, _, number, *_ = stat.read_text().rpartition(")")[2].split()
        except OSError:
            continue
        if int(number) == session and state != "Z":
            yield stat.parent.name
