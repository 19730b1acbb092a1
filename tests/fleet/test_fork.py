"""Forked child processes: their handlers of signals, and output that a full log cannot hold."""

import subprocess
import sys

DEADLINE_S = 20.0
FULL_LOG = """
import os, signal
from pathlib import Path
from worldsim.fleet.fork import ProcessExit, fork

def main():
    print("lost but for stderr")
    return 7

child = fork(Path("/dev/full"), signal.SIGKILL, main)
print(ProcessExit.of(os.waitpid(child, 0)[1]))
"""
ENDED_AT_ONCE = """
import os, signal
from worldsim.fleet.fork import ProcessExit, fork

def interrupt(*_):
    raise KeyboardInterrupt

def forked_and_ended(fork=os.fork):
    child = fork()
    if child == 0:
        os.kill(os.getpid(), signal.SIGTERM)
    return child

signal.signal(signal.SIGTERM, interrupt)
os.fork = forked_and_ended
child = fork(None, signal.SIGKILL, lambda: 0)
print(ProcessExit.of(os.waitpid(child, 0)[1]))
os.kill(os.getpid(), signal.SIGTERM)
"""


def ran(program: str) -> subprocess.CompletedProcess[str]:
    """Run a program to its end."""
    return subprocess.run(
        [sys.executable, "-c", program],
        capture_output=True,
        text=True,
        timeout=DEADLINE_S,
        check=False,
    )


def test_a_child_that_is_ended_at_once_does_not_run_the_parents_handler() -> None:
    ended = ran(ENDED_AT_ONCE)
    assert ended.stdout == "was killed by signal 15\n"
    assert ended.stderr.count("Traceback") == 1  # the parent's own


def test_output_that_a_full_log_cannot_hold_goes_to_stderr() -> None:
    ended = ran(FULL_LOG)
    assert ended.stdout == "ended with status 7\n"
    assert ended.stderr == "lost but for stderr\n"
