"""A live view: whatever becomes of its viewers, the run and its recording are as without."""

import json
import os
import signal
import socket
import sys
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace

import pytest

from tests.commands.conftest import Command
from tests.processes.harness import Started, eventually
from worldsim.fleet.fork import children
from worldsim.live import live_view
from worldsim.live.feeder import PIECE_B, Feed
from worldsim.live.live_view import LiveView
from worldsim.recording.rrd_file import is_finished
from worldsim.recording.viewer import Ports, ViewerError, free_ports
from worldsim.results.exit_status import INTERRUPTED

FROZEN = [sys.executable, "-c", "import signal; signal.pause()"]
"""A server that never reads."""
COPY = """
import os, sys
with open(sys.argv[1], "wb", buffering=0) as file:
    while piece := os.read(0, 65536):
        file.write(piece)
"""
FEEDER = [sys.executable, "-P", "-m", "worldsim.live.feeder"]
RECORDING_B = 32 * 1024 * 1024


def feed_of(folder: Path, server: list[str]) -> Feed:
    return Feed(
        parent=os.getpid(),
        recording=str(folder / "run.rrd"),
        server=server,
        ports=Ports(0, 0, 0),
        window=[],
        browser=False,
        printed=str(folder / "log"),
        memory_mb=100,
    )


@pytest.fixture
def fed(tmp_path: Path) -> Iterator[list[Started]]:
    """Feeders, which are ended with the test."""
    started: list[Started] = []
    yield started
    for each in started:
        each.process.kill()
        each.process.wait()


def start(fed: list[Started], folder: Path, server: list[str]) -> Started:
    spec = json.dumps(feed_of(folder, server))
    fed.append(Started([*FEEDER, spec], folder / "output", folder))
    return fed[0]


def grow(file: Path, by: bytes) -> None:
    with file.open("ab") as out:
        out.write(by)


def read(file: Path) -> bytes:
    return file.read_bytes() if file.exists() else b""


def memory_kb(pid: int) -> int:
    lines = Path(f"/proc/{pid}/status").read_text().splitlines()
    return next(int(line.split()[1]) for line in lines if line.startswith("VmRSS"))


def read_b(pid: int) -> int:
    """Return how much of the recording a feeder has read [bytes]."""
    try:
        files = Path(f"/proc/{pid}/fd").iterdir()
        number = next(file.name for file in files if file.readlink().name == "run.rrd")
        return int(Path(f"/proc/{pid}/fdinfo/{number}").read_text().split()[1])
    except (StopIteration, OSError):
        return 0


def slices(pid: int) -> int:
    """Return how often a process has run so far."""
    return int(Path(f"/proc/{pid}/schedstat").read_text().split()[2])


def test_a_server_that_never_reads_fills_no_memory_and_ends_with_the_feeder(
    fed: list[Started], tmp_path: Path
) -> None:
    feeder = start(fed, tmp_path, FROZEN)
    pid = feeder.process.pid
    grow(tmp_path / "run.rrd", b"x" * RECORDING_B)
    eventually(lambda: read_b(pid) > 0, 20.0, lambda: feeder.text)
    server = int(Path(f"/proc/{pid}/task/{pid}/children").read_text())
    before = slices(pid)
    eventually(lambda: slices(pid) > before + 10, 20.0)
    assert read_b(pid) <= PIECE_B, "no second piece before the first is passed on"
    assert memory_kb(pid) < 64 * 1024
    for each in (pid, server):
        assert os.getpriority(os.PRIO_PROCESS, each) == 19
        assert os.sched_getscheduler(each) == os.SCHED_IDLE
    os.kill(server, signal.SIGSTOP)
    feeder.process.terminate()
    assert feeder.status(within_s=5.0) == 0
    assert not Path(f"/proc/{server}").exists()


def test_a_server_gets_the_recording_as_it_grows(fed: list[Started], tmp_path: Path) -> None:
    got, recording = tmp_path / "got", tmp_path / "run.rrd"
    feeder = start(fed, tmp_path, [sys.executable, "-c", COPY, str(got)])
    for piece in (b"a" * 10, b"b" * (3 * PIECE_B), b"c"):
        grow(recording, piece)
        eventually(lambda: read(got) == read(recording), 10.0, lambda: feeder.text)


@pytest.mark.parametrize(
    ("server", "says"),
    [
        ("raise SystemExit('no port is free')", "the server ended with status 1: no port is free"),
        ("import os; os.close(0); os.kill(os.getpid(), 9)", "ended with signal 9: it printed"),
        ("", "the server was closed"),
        ("held = bytearray(200 << 20); input()", "is ended: it took more than 100 MB"),
    ],
)
def test_a_server_that_ends_is_reported(
    fed: list[Started], tmp_path: Path, server: str, says: str
) -> None:
    grow(tmp_path / "run.rrd", b"x" * (2 * PIECE_B))
    feeder = start(fed, tmp_path, [sys.executable, "-c", server])
    assert feeder.status(within_s=10.0) == 0
    assert feeder.text.startswith("live view: ")
    assert says in feeder.text


def test_what_was_started_ends_with_a_killed_feeder(fed: list[Started], tmp_path: Path) -> None:
    feeder = start(fed, tmp_path, FROZEN)
    listed = Path(f"/proc/{feeder.process.pid}/task/{feeder.process.pid}/children")
    eventually(lambda: bool(listed.read_text()), 10.0, lambda: feeder.text)
    server = listed.read_text().strip()
    feeder.process.kill()
    eventually(lambda: not Path(f"/proc/{server}").exists(), 5.0)


@pytest.fixture
def fake_viewer(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A viewer that never reads, in place of rerun's; it notes its process's number."""
    program = tmp_path / "viewer"
    program.write_text('#!/bin/sh\n[ "$1" = analytics ] && exit 0\necho $$ >pid\nexec sleep 600\n')
    program.chmod(0o755)
    monkeypatch.setattr(live_view, "viewer_program", lambda **_: str(program))
    monkeypatch.chdir(tmp_path)  # where it notes that
    return program


def test_a_watched_flight_is_the_same_and_leaves_no_process(
    small: Path,
    qswarm: Command,
    fake_viewer: Path,
) -> None:
    before = children()
    traces = []
    for name, live in (("plain", ()), ("watched", ("--live-web",))):
        printed = qswarm("sim", small, "--duration", "0.5", "--out", name, *live)
        assert printed.status == 1, printed  # too short to converge
        traces.append(json.loads(Path(name, "summary.json").read_text())["trace_sha256"])
    assert traces[0] == traces[1]
    assert is_finished(Path("watched", "run.rrd"))
    assert children() == before


@pytest.mark.parametrize(
    ("status", "terminal"), [(0, True), (1, True), (INTERRUPTED, True), (0, False)]
)
def test_viewers_stay_on_a_terminal_until_they_are_closed(
    tmp_path: Path,
    fake_viewer: Path,
    monkeypatch: pytest.MonkeyPatch,
    capfd: pytest.CaptureFixture[str],
    status: int,
    terminal: bool,
) -> None:
    stays = terminal and status != INTERRUPTED
    fake_viewer.write_text(fake_viewer.read_text().replace("sleep 600", "sleep 0.2"))
    monkeypatch.setattr("sys.stdin", SimpleNamespace(isatty=lambda: terminal))
    assert LiveView(browser=True).watch(tmp_path / "run.rrd", lambda: status) == status
    printed = capfd.readouterr().err
    assert ("it stays open; Ctrl-C ends it" in printed) is stays
    assert ("live view: the server was closed" in printed) is stays


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["--no-recording"], "qswarm: --live-web: needs the recording (see qswarm sim --help)\n"),
        (["--seeds", "1:3"], "qswarm: --live-web: shows one run, and these are many"),
    ],
)
def test_what_cannot_be_shown_is_refused(
    small: Path,
    qswarm: Command,
    fake_viewer: Path,
    arguments: list[str],
    says: str,
) -> None:
    printed = qswarm("sim", small, "--live-web", *arguments)
    assert (printed.status, printed.out) == (2, "")
    assert printed.err.startswith(says)
    assert not Path("runs").exists()


def test_without_viewer_or_display_nothing_is_started(
    small: Path,
    qswarm: Command,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    for display in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(display, raising=False)
    for command in ("sim", "run"):
        printed = qswarm(command, small, "--live")
        assert (printed.status, printed.out) == (2, "")
        assert printed.err == "no display for a window here; --live-web shows it in a browser\n"
    monkeypatch.setattr("worldsim.recording.viewer.find_spec", lambda _: None)
    with pytest.raises(ViewerError, match="not installed"):
        LiveView(browser=True).check()
    assert not Path("runs").exists()


def test_an_existing_folder_is_refused_and_not_shown(
    small: Path,
    qswarm: Command,
    fake_viewer: Path,
) -> None:
    Path("old").mkdir()
    Path("old", "run.rrd").touch()
    assert qswarm("sim", small, "--live-web", "--out", "old").status == 2
    assert not Path("pid").exists()


def test_ports_that_are_taken_are_not_used() -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        number = taken.getsockname()[1]
        ports = free_ports(number, number)
    assert number not in ports
    assert len({*ports}) == 3
