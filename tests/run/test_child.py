"""Forked children whose log takes no more: what they say is heard, and they end as they would."""

import subprocess
import sys

DEADLINE_S = 20.0
FULL_LOG = """
import os, signal
from pathlib import Path
from worldsim.run.child import Exit, fork

def main():
    print("what the log cannot hold")
    return 7

child = fork(Path("/dev/full"), signal.SIGKILL, main)
print(Exit.of(os.waitpid(child, 0)[1]))
"""


def test_a_log_on_a_full_disk_is_heard_on_stderr_and_stops_nobody() -> None:
    ended = subprocess.run(
        [sys.executable, "-c", FULL_LOG],
        capture_output=True,
        text=True,
        timeout=DEADLINE_S,
        check=False,
    )
    assert ended.stdout == "ended with status 7\n"
    assert ended.stderr == "what the log cannot hold\n"
