"""fleet.json: written whole, checked when read; and which processes are stopped unexpectedly."""

import json
import os
import signal
import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from worldsim.fleet.ipc import AgentProcess
from worldsim.fleet.process_table import (
    Fleet,
    ProcessRow,
    ProcessTable,
    processes,
    read_fleet,
    sweep_passwords,
)
from worldsim.results.run_folder import RunDirectoryError

AGENT_2 = [AgentProcess(2, 0)]
ENTRY = {"name": "netem", "pid": 17, "started": 4711}


@pytest.fixture
def table(tmp_path: Path) -> ProcessTable:
    return ProcessTable(tmp_path, "mine", "tcp/127.0.0.1:7447")


@pytest.fixture
def stopped() -> Iterator[int]:
    with subprocess.Popen(["cat"], stdin=subprocess.PIPE) as process:
        process.send_signal(signal.SIGSTOP)
        os.waitid(os.P_PID, process.pid, os.WSTOPPED)
        yield process.pid
        process.kill()


def test_a_stopped_process_is_reported_unless_its_pause_was_requested(
    stopped: int, table: ProcessTable
) -> None:
    table.add("netem", os.getpid())
    assert table.stopped() == []
    table.add("agent-2", stopped)
    assert table.stopped() == ["agent-2"]
    table.note_action("pause", AGENT_2)
    assert table.stopped() == []
    table.note_action("resume", AGENT_2)
    assert table.stopped() == ["agent-2"]


@pytest.mark.parametrize("action", ["kill", "start"])
def test_a_requested_pause_ends_with_its_process(
    stopped: int, table: ProcessTable, action: Any
) -> None:
    table.add("agent-2", stopped)
    table.note_action("pause", AGENT_2)
    table.note_action(action, AGENT_2)
    assert table.stopped() == ["agent-2"]


def test_a_process_that_has_ended_is_not_stopped(table: ProcessTable) -> None:
    with subprocess.Popen(["true"]) as process:
        process.wait(5.0)
    table.add("agent-0", process.pid)
    assert table.stopped() == []


def test_a_written_table_is_read_back(table: ProcessTable, tmp_path: Path) -> None:
    table.add("netem", 1)
    table.add("netem", os.getpid())
    table.write()
    row = ProcessRow("netem", os.getpid(), True)
    assert read_fleet(tmp_path) == Fleet("mine", "tcp/127.0.0.1:7447", [row])
    assert json.loads((tmp_path / "fleet.json").read_text()).keys() == {
        "run",
        "endpoint",
        "processes",
    }


def test_a_reused_pid_is_not_the_process_of_the_table(table: ProcessTable, tmp_path: Path) -> None:
    table.add("self", os.getpid())
    table.write()
    file = tmp_path / "fleet.json"
    file.write_text(file.read_text().replace('"started": ', '"started": 1'))
    assert processes(tmp_path) == [("self", os.getpid(), False)]


def test_a_process_that_ended_at_once_is_not_alive(table: ProcessTable, tmp_path: Path) -> None:
    with subprocess.Popen(["true"]) as process:
        process.wait(5.0)
    table.add("agent-0", process.pid)
    table.write()
    assert processes(tmp_path) == [("agent-0", process.pid, False)]


def test_a_folder_without_a_table_is_not_a_process_run(tmp_path: Path) -> None:
    with pytest.raises(RunDirectoryError) as refusal:
        processes(tmp_path)
    assert str(refusal.value) == f"{tmp_path}: not a process run (no fleet.json)"


def content(**changes: Any) -> str:
    return json.dumps({"run": "mine", "endpoint": "tcp/x", "processes": [ENTRY], **changes})


INVALID = [
    ("{}", "Object missing required field `run`"),
    ("", "Input data was truncated"),
    ("[]", "Expected `object`, got `array`"),
    (content(run=3), "Expected `str`, got `int` - at `$.run`"),
    (content(processes=[{**ENTRY, "pid": "1"}]), "got `str` - at `$.processes[0].pid`"),
    (content(processes=[{**ENTRY, "pid": 0}]), "Expected `int` >= 1 - at `$.processes[0].pid`"),
    (content(processes=[{"name": "netem", "pid": 1}]), "field `started` - at `$.processes[0]`"),
    (content(processes=[{**ENTRY, "started": -1}]), ">= 0 - at `$.processes[0].started`"),
]


@pytest.mark.parametrize(("text", "reason"), INVALID, ids=[reason for _, reason in INVALID])
def test_an_invalid_table_is_refused_with_the_field_at_fault(
    tmp_path: Path, text: str, reason: str
) -> None:
    (tmp_path / "fleet.json").write_text(text)
    with pytest.raises(RunDirectoryError) as refusal:
        processes(tmp_path)
    message = str(refusal.value)
    assert message.startswith(f"{tmp_path}/fleet.json: not a valid fleet.json: ")
    assert message.endswith(reason)


@pytest.mark.parametrize("data", [b'{"run": "\xff"}', b"\xff\xfe", content().encode() + b"\xff"])
def test_a_table_that_is_not_text_is_refused(tmp_path: Path, data: bytes) -> None:
    (tmp_path / "fleet.json").write_bytes(data)
    with pytest.raises(RunDirectoryError, match=r"not a valid fleet\.json"):
        processes(tmp_path)


@pytest.mark.parametrize("deep", ["[" * 100_000, '{"a":' * 100_000])
def test_a_deeply_nested_table_is_refused(tmp_path: Path, deep: str) -> None:
    (tmp_path / "fleet.json").write_text('{"run": "r", "endpoint": "e", "processes": ' + deep)
    with pytest.raises(RunDirectoryError, match=r"not a valid fleet\.json: "):
        read_fleet(tmp_path)


@pytest.mark.parametrize("alive", [True, False])
def test_passwords_of_a_killed_launcher_are_swept(tmp_path: Path, alive: bool) -> None:
    with subprocess.Popen(["cat"], stdin=subprocess.PIPE) as process:
        for name in ("one", "two"):
            (tmp_path / name).mkdir()
            (tmp_path / name / "users").touch()
        table = ProcessTable(tmp_path / "one", "one", "tcp/127.0.0.1:7447")
        table.add("netem", process.pid)
        table.write()
        if not alive:
            process.kill()
            process.wait(5.0)
        sweep_passwords(tmp_path)
    assert (tmp_path / "one/users").exists() is alive
    assert (tmp_path / "two/users").exists()  # of a run that nothing is known of
