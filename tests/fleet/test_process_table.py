"""Whose process is stopped: told, unless it is paused as planned."""

import os
import signal
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest

from worldsim.fleet.process_table import ProcessTable


@pytest.fixture
def stopped() -> Iterator[int]:
    with subprocess.Popen(["cat"], stdin=subprocess.PIPE) as process:
        process.send_signal(signal.SIGSTOP)
        os.waitid(os.P_PID, process.pid, os.WSTOPPED)
        yield process.pid
        process.kill()


def test_who_is_stopped_is_told_but_who_is_paused_is_not(stopped: int, tmp_path: Path) -> None:
    table = ProcessTable(tmp_path, "mine", "tcp/127.0.0.1:7447")
    table.add("netem", os.getpid())
    assert table.stopped() == ""
    table.add("agent-2", stopped)
    assert table.stopped() == "; stopped: agent-2"
    table.note("pause", [(2, 0)])
    assert table.stopped() == ""
    table.note("resume", [(2, 0)])
    assert table.stopped() == "; stopped: agent-2"


def test_who_is_gone_is_not_stopped(tmp_path: Path) -> None:
    with subprocess.Popen(["true"]) as process:
        process.wait(5.0)
    table = ProcessTable(tmp_path, "mine", "tcp/127.0.0.1:7447")
    table.add("agent-0", process.pid)
    assert table.stopped() == ""
