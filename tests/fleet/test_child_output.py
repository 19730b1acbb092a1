"""A child's log: bounded, with its begin and its end; and the end of what the child starts."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from worldsim.fleet.child_output import KEPT_TAIL_B, MAX_LOG_B

PROGRAM = """
import os, signal, sys, time
from pathlib import Path
from worldsim.fleet.fork import ProcessExit, adopt_orphans, end_orphans, fork

def main():
    {main}
    return 7

adopt_orphans()
child = fork({output}, signal.SIGKILL, main)
print(ProcessExit.of(os.waitpid(child, 0)[1]))
print(end_orphans(()), "orphans")
"""
SPAWN = 'os.posix_spawn("/bin/sleep", ["sleep", "600"], {})'


def ran(main: str, output: str, folder: Path) -> str:
    path = str(Path(__file__).parents[2])
    ended = subprocess.run(
        [sys.executable, "-c", PROGRAM.format(main=main, output=output)],
        capture_output=True,
        text=True,
        timeout=20.0,
        check=False,
        cwd=folder,
        env={**os.environ, "PYTHONPATH": path},
    )
    assert ended.stderr == ""
    return ended.stdout


def test_a_log_keeps_its_begin_and_its_end(tmp_path: Path) -> None:
    main = 'print("first"); [print("x" * 1000) for _ in range(4000)]; print("last")'
    assert ran(main, 'Path("log")', tmp_path).startswith("ended with status 7\n")
    log = (tmp_path / "log").read_text()
    assert log.startswith("first\nxxx")
    assert log.endswith("x\nlast\n")
    assert len(log) < MAX_LOG_B + 2 * KEPT_TAIL_B + 200
    (mark,) = re.findall(r"\n\[(\d+) B dropped: a log holds \d+ B and its end\]\n", log)
    assert int(mark) + len(log) > 4000 * 1001


def test_a_short_log_has_no_mark(tmp_path: Path) -> None:
    ran('print("short")', 'Path("log")', tmp_path)
    assert (tmp_path / "log").read_text() == "short\n"


@pytest.mark.parametrize(
    "main",
    [
        "os.closerange(0, 64)",
        "sys.stdout.close(); sys.stderr.close()",
        "sys.stdout = sys.stderr = None",
    ],
)
def test_a_child_without_streams_ends_with_its_own_status(tmp_path: Path, main: str) -> None:
    assert ran(main, 'Path("log")', tmp_path).startswith("ended with status 7\n")


@pytest.mark.parametrize(
    ("main", "count"),
    [("pass", 0), (SPAWN, 1), (f"[{SPAWN} for _ in range(3)]", 3)],
)
def test_what_a_child_starts_is_ended(tmp_path: Path, main: str, count: int) -> None:
    assert ran(main, "None", tmp_path) == f"ended with status 7\n{count} orphans\n"


def test_what_a_child_forks_dies_with_it(tmp_path: Path) -> None:
    main = "pid = os.fork(); time.sleep(600) if not pid else print(pid, flush=True)"
    program = f"""
import os, signal, sys, time
from worldsim.fleet.fork import fork
def main():
    {main}
    return 0
os.waitpid(fork(None, signal.SIGKILL, main), 0)
"""
    done = subprocess.run(
        [sys.executable, "-c", program],
        stdout=subprocess.PIPE,
        timeout=20.0,
        check=True,
        cwd=Path(__file__).parents[2],
    )  # the pipe ends once no process holds it
    assert int(done.stdout) > 0
