"""sim: one run or many, each in its own folder, with the verdict as exit status."""

import json
import signal
from pathlib import Path
from typing import Any

import pytest

from tests.commands.conftest import PROGRESS, Command
from tests.processes.harness import QSWARM, Started, eventually
from worldsim.scenario.file import load


def summary(folder: str | Path) -> dict[str, Any]:
    return json.loads((Path(folder) / "summary.json").read_text())  # type: ignore[no-any-return]


def test_one_run_writes_its_folder(small: Path, qswarm: Command) -> None:
    printed = qswarm("sim", small, "--no-recording", "--out", "deep/one")
    assert printed.status == 0
    assert printed.out.splitlines()[-1] == "pass  deep/one/summary.json"
    names = sorted(path.name for path in Path("deep/one").iterdir())
    assert names == ["events.jsonl", "logs", "scenario.toml", "summary.json"]
    assert load(Path("deep/one/scenario.toml")) == load(small)
    lines = Path("deep/one/events.jsonl").read_text().splitlines()
    assert all({"t_s", "kind", "agent"} <= json.loads(line).keys() for line in lines)
    assert summary("deep/one")["mode"] == "virtual"


def test_a_recording_is_made_and_verified(small: Path, qswarm: Command) -> None:
    assert qswarm("sim", small, "--out", "seen").status == 0
    printed = qswarm("verify", "seen")
    assert printed.status == 0
    assert "summary.json agrees" in printed.out


@pytest.mark.parametrize("more", [(), ("--seeds", "0:2", "--jobs", "1")])
def test_a_warning_is_printed_once(small: Path, qswarm: Command, more: tuple[str, ...]) -> None:
    printed = qswarm("sim", small, "--no-recording", "--set", "netem.range_m=0.9", *more)
    assert printed.err.startswith(f"{small}: netem.range_m: warning: ")
    assert printed.err.count(": warning: ") == 1


def test_without_out_the_folder_is_named_after_scenario_and_time(
    small: Path, qswarm: Command
) -> None:
    for _ in range(2):
        assert qswarm("sim", small, "--no-recording").status == 0
    folders = sorted(Path("runs").iterdir())
    assert len(folders) == 2
    assert all(folder.name.startswith("small-2") for folder in folders)


def test_an_expectation_that_is_not_met_is_exit_1(small: Path, qswarm: Command) -> None:
    printed = qswarm(
        "sim", small, "--no-recording", "--out", "late", "--set", "expect.converge_within_s=0.01"
    )
    assert printed.status == 1
    assert "NOT MET  line: converged in " in printed.out
    assert summary("late")["outcome"] == "fail"
    reason = summary("late")["reason"]
    assert reason.startswith("line: converged in ")
    assert " s (limit 0.01 s; margin -" in reason


def test_the_trace_depends_on_the_seed_alone(small: Path, qswarm: Command) -> None:
    for out, seed in (("a", "1"), ("b", "1"), ("c", "2")):
        qswarm(
            "sim", small, "--no-recording", "--out", out, "--seed", seed,
            "--set", "netem.loss_percent=50",
        )  # fmt: skip
    traces = [summary(out)["trace_sha256"] for out in "abc"]
    assert traces[0] == traces[1] != traces[2]


@pytest.mark.parametrize("jobs", ["1", "2"])
def test_many_seeds_have_a_folder_each_and_a_summary_over_all(
    small: Path, qswarm: Command, jobs: str
) -> None:
    printed = qswarm(
        "sim", small, "--no-recording", "--seeds", "3:6", "--jobs", jobs, "--out", "many"
    )
    assert printed.status == 0
    assert [row.split()[0] for row in printed.out.splitlines()[1:4]] == [
        "small-seed3",
        "small-seed4",
        "small-seed5",
    ]
    overall = summary("many")
    assert (overall["runs"], overall["outcome"]) == (3, "pass")
    (scenario,) = overall["scenarios"]
    assert scenario["pass"] == 3
    assert scenario["converge_s"].keys() == {"min", "median", "max", "measured"}
    for row in overall["rows"]:
        own = summary(Path("many") / row["run"])
        assert own["trace_sha256"] == row["trace_sha256"]
        assert own["min_separation_m"] == row["min_separation_m"]


def test_a_folder_of_many_runs_is_not_verified(small: Path, qswarm: Command) -> None:
    qswarm("sim", small, "--no-recording", "--seeds", "0:2", "--jobs", "1", "--out", "many")
    printed = qswarm("verify", "many")
    assert (printed.status, printed.out) == (2, "")
    assert printed.err == "many: a folder of many runs; name one of them\n"


def test_one_failed_seed_fails_all(small: Path, qswarm: Command) -> None:
    other = small.with_name("hard.toml")
    other.write_text(small.read_text().replace('"small"', '"hard"'))
    other.write_text(other.read_text() + "[expect]\nconverge_within_s = 0.01\n")
    printed = qswarm("sim", small, other, "--no-recording", "--out", "both")
    assert printed.status == 1
    assert "hard: 0 of 1 run passed" in printed.out
    assert "small: 1 of 1 run passed" in printed.out
    assert [row["run"] for row in summary("both")["rows"]] == ["small-seed1", "hard-seed1"]


FRAGILE = """
from agent.controller import Intent

class Fragile:
    def __init__(self, setup):
        self.agent = setup.id

    def decide(self, senses):
        if self.agent == 0 and senses.position[0] < -1.0:
            raise ValueError("lost")
        return Intent((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), senses.yaw, 0.0, senses.position)
"""
"""A controller that fails where agent 0 starts far behind the origin: at some seeds."""


@pytest.mark.parametrize("jobs", ["1", "2"])
def test_a_failing_controller_fails_its_own_seed_alone(
    small: Path, qswarm: Command, monkeypatch: pytest.MonkeyPatch, jobs: str
) -> None:
    monkeypatch.syspath_prepend(small.parent)
    monkeypatch.setenv("PYTHONPATH", str(small.parent))
    small.with_name("fragile.py").write_text(FRAGILE)
    boxed = small.read_text().replace('"list", positions_m = [[0.3, 0, 0], [-1.3, 0, 0]]', '"box"')
    small.write_text(boxed)
    printed = qswarm(
        "sim", small, "--no-recording", "--seeds", "0:3", "--jobs", jobs, "--out", "many",
        "--set", "control.controller=fragile:Fragile", "--set", "expect.converge=false",
    )  # fmt: skip
    assert (printed.status, PROGRESS.sub("", printed.err)) == (1, "")
    rows = summary("many")["rows"]
    outcomes = {row["seed"]: row["outcome"] for row in rows}
    assert sorted(outcomes) == [0, 1, 2]
    assert set(outcomes.values()) == {"pass", "fail"}, printed.out
    failed = next(row for row in rows if row["outcome"] == "fail")
    assert failed["reason"].startswith("controller 'fragile:Fragile' of agent ")
    assert failed["reason"].endswith("ValueError: lost")
    assert f"fail ({failed['reason']})" in printed.out


def is_running(pid: str) -> bool:
    try:
        state = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0]
    except OSError:
        return False
    return state not in "ZX"


def long_sim(jobs: str, *more: str) -> Started:
    sweep = [*QSWARM, "sim", "small.toml", "--duration", "1000", *more]
    return Started([*sweep, "--jobs", jobs, "--out", "cut"], Path("output"), Path.cwd())


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_ctrl_c_ends_a_run_with_its_summary(small: Path, number: signal.Signals) -> None:
    with long_sim("1") as started:
        eventually(lambda: has_events("cut"), 20.0)
        started.process.send_signal(number)
        assert started.status(within_s=20.0) == 130, small
    printed = summary("cut")
    assert printed["outcome"] == "inconclusive"
    assert printed["reason"] == f"interrupted after {printed['duration_s']:.1f} s"
    assert 0.0 < printed["duration_s"] < 1000.0
    assert f"inconclusive ({printed['reason']})" in started.text
    assert Path("cut/run.rrd").stat().st_size > 0


@pytest.mark.parametrize("jobs", ["1", "2"])
def test_ctrl_c_ends_a_sweep_with_its_workers_and_summaries(small: Path, jobs: str) -> None:
    with long_sim(jobs, "--no-recording", "--seeds", "0:4") as started:
        pid, started_runs = started.process.pid, int(jobs)
        eventually(lambda: sum(map(has_events, Path("cut").glob("*"))) >= started_runs, 20.0)
        workers = Path(f"/proc/{pid}/task/{pid}/children").read_text().split()
        started.process.send_signal(signal.SIGINT)
        assert started.status(within_s=20.0) == 130, small
    overall = summary("cut")
    reason = f"interrupted: 0 of 4 runs done, {overall['runs']} cut off"
    assert (overall["outcome"], overall["reason"]) == ("inconclusive", reason)
    assert started_runs <= overall["runs"] == len(list(Path("cut").glob("*/summary.json"))) < 4
    assert started.text.endswith(f"\n{reason}; 0 passed, 0 failed  cut/summary.json\n")
    eventually(lambda: not any(map(is_running, workers)), 10.0)


def has_events(run: str | Path) -> bool:
    """Whether a run is under way: an agent has taken a slot."""
    events = Path(run) / "events.jsonl"
    return events.exists() and events.stat().st_size > 0
