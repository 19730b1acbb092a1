"""Netem and the world struck as processes: by the timeline, and by kill -9 from outside."""

import json
import os
import re
import signal
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from tests.processes.harness import QSWARM, Started, events_of, eventually, pids
from tests.processes.test_fleet import launched, none_left, running, summary_of

pytestmark = pytest.mark.processes

Start = Callable[..., Started]
Write = Callable[[float], str]


@pytest.fixture
def run(tmp_path: Path) -> Path:
    return tmp_path / "run"


@pytest.fixture
def with_event(scenario: Write) -> Callable[[float, str], str]:
    def write(duration_s: float, *events: str) -> str:
        path = Path(scenario(duration_s))
        tables = "".join(f"\n[[event]]\n{event}\n" for event in events)
        path.write_text(path.read_text() + tables)
        return str(path)

    return write


def outages(run: Path) -> list[tuple[str, bool]]:
    kinds = ("netem_outage", "world_outage", "reconnect")
    return [(e["kind"], e.get("over", False)) for e in events_of(run) if e["kind"] in kinds]


def verified(run: Path) -> Any:
    from worldsim.recording.verify import verify  # noqa: PLC0415 - a second that other tests save

    return verify(run)


@pytest.mark.real_time
@pytest.mark.parametrize("fault", ["kill", "pause"])
def test_a_fleet_outlives_an_outage_of_netem(
    start: Start, with_event: Callable[..., str], run: Path, fault: str
) -> None:
    jam = "at_s = 4\njam = { centre_m = [0, 0, 0], radius_m = 0.2 }"
    outage = f"at_s = 4.5\nfor_s = 2\n{fault} = ['netem']"
    loss = "at_s = 5\nnetem = { loss_percent = 20 }"
    restart = "at_s = 7.5\nfor_s = 0.5\nkill = [3]"
    options = ("--no-recording", "--speed", "2")
    fleet = launched(start, with_event(11.0, jam, outage, loss, restart), run, *options)
    fleet.wait_for_output("minimum separation")
    before = pids(run)["netem"]
    assert fleet.status(30.0) in (0, 1), fleet.text

    assert outages(run) == [("netem_outage", False), ("netem_outage", True), ("reconnect", False)]
    (reconnected,) = [e for e in events_of(run) if e["kind"] == "reconnect"]
    assert reconnected.get("missing", []) == []
    assert reconnected["after_s"] < 2.0
    assert [e for e in events_of(run) if e["kind"] == "late"] == [], "liveliness is back too"
    assert (pids(run)["netem"] == before) == (fault == "pause")
    assert ("netem was killed by signal 9 at about" in fleet.text) == (fault == "kill")

    summary = summary_of(run)
    assert summary["duration_s"] == 11.0
    counts = summary["invariants"]
    assert [counts[name]["violations"] for name in ("I1", "I8")] == [0, 0], summary
    rows = {row["kind"]: row for row in reversed(summary["faults"])}
    assert rows[fault]["observations"] == 4 * 2 * 20
    assert rows["jam"]["frames"] > 4 * 20, "the jam holds on after the outage"
    packets = summary["packets"]
    assert packets["dropped_loss"] > 0, "a change during the outage reaches netem"
    in_air = packets["addressed"] - packets["in_flight"]
    fates = ("delivered", "dropped_range", "dropped_loss", "dropped_partition", "dropped_queue")
    assert in_air == sum(packets[name] for name in fates) + packets["dropped_medium"]
    # The kill of agent 3 may drop what is on its way to it, also where netem was only paused.
    assert packets["dropped_medium"] > 0 or fault == "pause"
    none_left(pids(run))


@pytest.mark.real_time
@pytest.mark.parametrize("fault", ["kill", "pause"])
def test_a_fleet_without_netem_hovers_to_the_end(
    start: Start, with_event: Callable[..., str], run: Path, fault: str
) -> None:
    options = ("--no-recording", "--speed", "2")
    fleet = launched(start, with_event(8.0, f"at_s = 5\n{fault} = ['netem']"), run, *options)
    assert fleet.status(20.0) in (0, 1), fleet.text
    summary = summary_of(run)
    assert summary["duration_s"] == 8.0
    assert (summary["packets"]["in_flight"] == 0) or fault == "pause"
    (row,) = summary["faults"]
    assert (row["process"], row["to_s"], row["observations"]) == ("netem", None, 4 * 3 * 20)
    none_left(pids(run))


@pytest.mark.real_time
def test_an_operator_reaches_a_fleet_whose_netem_is_down(
    start: Start, scenario: Write, run: Path
) -> None:
    fleet = launched(start, scenario(60.0), run, "--no-recording", "--speed", "2")
    fleet.wait_for_output("minimum separation")

    def command(*words: str) -> str:
        operator = start(*QSWARM, "fault", str(run), *words)
        assert operator.status(10.0) == 0, operator.text
        return operator.text

    assert "its name, to end it early: kill-" in command("kill", "netem")
    before = pids(run)["netem"]
    eventually(lambda: not running(before), 5.0)
    command("restart", "netem")
    eventually(lambda: len(outages(run)) == 3, 10.0, lambda: fleet.text)
    assert outages(run)[-1] == ("reconnect", False)
    refused = start(*QSWARM, "fault", str(run), "restart", "netem")
    assert refused.status(10.0) == 2
    assert refused.text == f"{run}: refused: netem: no kill of it is in force\n"
    fleet.kill_group(signal.SIGINT)
    assert fleet.status(10.0) == 130, fleet.text
    none_left(pids(run))


@pytest.mark.real_time
def test_the_world_is_paused_and_woken(
    start: Start, with_event: Callable[..., str], run: Path
) -> None:
    event = with_event(5.5, "at_s = 3\nfor_s = 1.5\npause = ['world']")
    fleet = launched(start, event, run)
    assert fleet.status(30.0) in (0, 1), fleet.text
    summary = summary_of(run)
    (row,) = summary["faults"]
    assert (row["process"], row["from_s"], row["to_s"]) == ("world", 3.0, 3.0)
    assert 1.4 < row["stopped_s"] < 3.0
    assert outages(run) == [("world_outage", False), ("reconnect", False)]
    assert summary["duration_s"] == 5.5
    assert summary["real_time_factor"] > 0.9, "the planned pause is no slowness"
    verification = verified(run)
    assert (verification.whole, verification.differences) == (True, ()), verification


@pytest.mark.parametrize("planned", [True, False])
def test_a_killed_world_leaves_its_recording_to_judge(
    start: Start, with_event: Callable[..., str], run: Path, planned: bool
) -> None:
    events = ["at_s = 3\nkill = ['world']"] if planned else []
    fleet = launched(start, with_event(60.0, *events), run)
    fleet.wait_for_output("minimum separation")
    started = pids(run)
    if not planned:
        eventually(lambda: time_s(fleet.text) > 2.5, 10.0)
        os.kill(started["world"], signal.SIGKILL)
    assert fleet.status(15.0) == 3, fleet.text
    eventually(lambda: not any(running(pid) for pid in started.values()), 2.0)

    scheduled = " (scheduled)" if planned else ""
    line = rf"^world was killed by signal 9 at about \d+\.\d s{re.escape(scheduled)}; the run ends$"
    assert re.search(line, fleet.text, re.M), fleet.text
    assert fleet.text.endswith(f"judge the recording up to then: qswarm verify {run}\n")
    assert not (run / "users").exists()
    assert not (run / ".reserve").exists()
    verification = verified(run)
    assert (verification.exit_status, verification.finished) == (3, False)
    assert verification.until_s > time_s(fleet.text) - 1.5, "all but the last second"
    assert verification.invariants["I1"].violations == 0


def test_a_killed_launcher_leaves_a_recording_to_judge(
    start: Start, scenario: Write, run: Path
) -> None:
    fleet = launched(start, scenario(60.0), run)
    eventually(lambda: time_s(fleet.text) > 2.0, 15.0)
    started = pids(run)
    fleet.process.kill()
    eventually(lambda: not any(running(pid) for pid in started.values()), 2.0)
    verification = verified(run)
    assert verification.exit_status == 3
    assert verification.until_s > 1.0
    assert json.loads((run / "summary.json").read_text())["reason"].startswith("the launcher is")


def test_a_paused_world_dies_with_its_launcher(
    start: Start, with_event: Callable[..., str], run: Path
) -> None:
    event = with_event(60.0, "at_s = 1\nfor_s = 60\npause = ['world']")
    fleet = launched(start, event, run, "--no-recording")
    eventually(lambda: (run / "events.jsonl").exists() and bool(outages(run)), 15.0)
    started = pids(run)
    state = Path(f"/proc/{started['world']}/stat")
    eventually(lambda: state.read_text().rpartition(")")[2].split()[0] == "T", 5.0)
    fleet.process.kill()
    eventually(lambda: not any(running(pid) for pid in started.values()), 2.0)


def test_ctrl_c_ends_a_run_whose_world_is_paused(
    start: Start, with_event: Callable[..., str], run: Path
) -> None:
    event = with_event(60.0, "at_s = 1\nfor_s = 60\npause = ['world']")
    fleet = launched(start, event, run, "--no-recording")
    eventually(lambda: (run / "events.jsonl").exists() and bool(outages(run)), 15.0)
    fleet.kill_group(signal.SIGINT)
    assert fleet.status(8.0) == 130, fleet.text
    assert "interrupted" in summary_of(run)["reason"]
    none_left(pids(run))


def test_an_operator_kills_netem_and_it_comes_back(
    start: Start, scenario: Write, run: Path
) -> None:
    fleet = launched(start, scenario(60.0), run, "--no-recording")
    fleet.wait_for_output("minimum separation")
    asked = start(*QSWARM, "fault", str(run), "kill", "netem", "--for", "0.5")
    assert asked.status(10.0) == 0, asked.text
    assert asked.text.splitlines()[0].endswith(
        "netem is killed; no message passes (by the operator)"
    )
    eventually(lambda: ("reconnect", False) in outages(run), 10.0)
    refused = start(*QSWARM, "fault", str(run), "kill", "netem", "2")
    assert refused.status(10.0) == 2
    assert "'netem' is no agent; allowed alone" in refused.text
    fleet.kill_group(signal.SIGINT)
    assert fleet.status(10.0) == 130


def time_s(text: str) -> float:
    """Return the simulated time of the last line of progress [s]."""
    times = re.findall(r"^ *(\d+\.\d) of ", text, re.M)
    return float(times[-1]) if times else 0.0
