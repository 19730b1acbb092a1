"""The timeline on real processes: kills, restarts, joins, leaves and pauses; radio faults."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from tests.processes.harness import QSWARM, Started, events_of, pids

pytestmark = pytest.mark.processes

Start = Callable[..., Started]
Write = Callable[..., str]
PROCESS_EVENTS = ("kill", "leave", "join", "restart", "pause", "resume", "late")


@pytest.fixture
def run(tmp_path: Path) -> Path:
    return tmp_path / "run"


@pytest.fixture
def timeline(scenario: Callable[[float], str]) -> Write:
    def write(duration_s: float, *events: str) -> str:
        path = Path(scenario(duration_s))
        tables = "".join(f"\n[[event]]\n{event}\n" for event in events)
        path.write_text(path.read_text().replace("agents = 4", "agents = 4\nboot_s = 0.5") + tables)
        return str(path)

    return write


def summary_after(start: Start, scenario: str, run: Path) -> dict[str, Any]:
    fleet = start(*QSWARM, "run", scenario, "--out", str(run), "--no-recording", "--speed", "2")
    assert fleet.status(40.0) in (0, 1), fleet.text
    summary: dict[str, Any] = json.loads((run / "summary.json").read_text())
    counts = summary["invariants"]
    assert [counts[name]["violations"] for name in ("I1", "I8")] == [0, 0], summary
    return summary


def process_events(run: Path) -> list[tuple[float, str, int, bool]]:
    return [
        (event["t_s"], event["kind"], event["agent"], event["planned"])
        for event in events_of(run)
        if event["kind"] in PROCESS_EVENTS
    ]


@pytest.mark.real_time
def test_killed_agents_restart_as_new_processes(start: Start, timeline: Write, run: Path) -> None:
    summary = summary_after(start, timeline(11.0, "at_s = 3\nkill = [1, 2]\nfor_s = 1.5"), run)
    assert process_events(run) == [
        (3.0, "kill", 1, True),
        (3.0, "kill", 2, True),
        (4.5, "restart", 1, True),
        (4.5, "restart", 2, True),
    ]
    assert (run / "logs/agent-1.log").read_text().count("flies in run") == 2
    assert [recovery["kind"] for recovery in summary["recoveries"]] == ["kill", "restart"]
    assert summary["recoveries"][1]["reformed_s"] is not None
    claims = [
        e for e in events_of(run) if e["kind"] == "slot" and e["agent"] == 1 and e["t_s"] > 4.5
    ]
    assert claims[0]["t_s"] >= 5.0


@pytest.mark.real_time
def test_agents_join_and_leave(start: Start, timeline: Write, run: Path) -> None:
    places = "{ kind = 'list', positions_m = [[-4.2, 0.3, 0], [-5.1, 0, 0]] }"
    joins = f"at_s = 4\njoin = {{ count = 2, start = {places} }}"
    summary = summary_after(start, timeline(19.0, joins, "at_s = 9\nleave = [0, 3]"), run)
    assert process_events(run) == [
        (4.0, "join", 4, True),
        (4.0, "join", 5, True),
        (9.0, "leave", 0, True),
        (9.0, "leave", 3, True),
    ]
    assert {"agent-4", "agent-5"} <= pids(run).keys()
    assert [recovery["reformed_s"] is not None for recovery in summary["recoveries"]] == [True] * 2


@pytest.mark.real_time
def test_a_paused_agent_is_silent_and_continues(start: Start, timeline: Write, run: Path) -> None:
    summary = summary_after(start, timeline(9.5, "at_s = 3\npause = [1]\nfor_s = 3"), run)
    assert process_events(run) == [(3.0, "pause", 1, True), (6.0, "resume", 1, True)]
    assert not [e for e in events_of(run) if e["agent"] == 1 and 3.0 < e["t_s"] < 6.0]
    assert [recovery["reformed_s"] is not None for recovery in summary["recoveries"]] == [True] * 2
    assert (run / "logs/agent-1.log").read_text().count("flies in run") == 1


@pytest.mark.real_time
def test_the_radio_is_partitioned_healed_and_degraded(
    start: Start, timeline: Write, run: Path
) -> None:
    partition = "at_s = 2\npartition = [[0, 1]]\nfor_s = 1"
    degraded = "at_s = 4\nnetem = { loss_percent = 60 }\nfor_s = 1"
    packets = summary_after(start, timeline(6.0, partition, degraded), run)["packets"]
    # 4 agents send 20 frames a second: 2 * 2 of 4 * 3 links are cut each way.
    assert 0.8 < packets["dropped_partition"] / (8 * 22) < 1.2
    assert 0.6 < packets["dropped_loss"] / (12 * 22 * 0.6) < 1.4
    kinds = [event["kind"] for event in events_of(run) if event["t_s"] >= 2.0]
    assert [kind for kind in kinds if kind in {"partition", "heal", "netem"}] == [
        "partition",
        "heal",
        "netem",
        "netem",
    ]


def test_by_hand_process_faults_are_refused_at_the_start(
    start: Start, timeline: Write, endpoint: str, run: Path
) -> None:
    scenario = timeline(6.0, "at_s = 2\npartition = [[0, 1]]", "at_s = 3\nkill = [2]")
    python = QSWARM[0]
    world = start(python, "-m", "worldsim", scenario, "--connect", endpoint, "--out", str(run))
    assert world.status(10.0) == 2
    reason = "needs the launcher (qswarm run): processes started by hand are ended by hand"
    assert world.text == f"world: {scenario}: event[1].kill: {reason}\n"
    assert not run.exists()


@pytest.mark.real_time
def test_slow_and_starved_processes_answer_late_and_stay_in_the_team(
    start: Start, timeline: Write, run: Path
) -> None:
    """What a slow agent says leaves late, and is heard; its commands are too old."""
    slow = "at_s = 3\nfor_s = 3\nslow = { agents = [1], delay_s = 0.2 }"
    starved = "at_s = 7\nfor_s = 3\nstarve = { agents = [2, 3], cpu_percent = 20 }"
    summary = summary_after(start, timeline(12.0, slow, starved), run)
    assert [(row["kind"], row["steps"] > 20) for row in summary["faults"]] == [
        ("slow", True),
        ("starve", True),
    ]
    stale = {name: causes.get("stale", 0) for name, causes in summary["rejected_by_cause"].items()}
    assert stale["world"] > 5
    assert stale["netem"] < stale["world"]
    moved = [e for e in events_of(run) if e["kind"] in {"slot", "role"} and e["t_s"] > 4.0]
    assert moved == []
