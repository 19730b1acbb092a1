"""Verdicts of fleets on a host that other programs keep busy: ``python -m tests.host_load``.

A run whose host was too slow must be inconclusive, name the late process and say what to do. It
never passes, and fails only where safety was broken by an agent that was on time. Run it by hand.
"""

import argparse
import json
import os
import signal
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

BUSY = "while True: pass"
QSWARM = [sys.executable, "-c", "from worldsim.commands.app import main; main()"]


@contextmanager
def busy_loops(number: int) -> Iterator[None]:
    """Keep cores busy until the block is left."""
    started = [subprocess.Popen([sys.executable, "-c", BUSY]) for _ in range(number)]
    try:
        yield
    finally:
        for each in started:
            each.send_signal(signal.SIGKILL)
            each.wait()


def flown(arguments: list[str], loops: int) -> tuple[int, dict[str, Any]]:
    """Fly a fleet beside busy loops; return its exit status and its summary."""
    with tempfile.TemporaryDirectory() as folder, busy_loops(loops):
        run = Path(folder) / "run"
        command = [*QSWARM, "run", *arguments, "--no-recording", "--out", str(run)]
        ended = subprocess.run(command, capture_output=True, text=True, check=False)
        for line in ended.stdout.splitlines():
            if line.startswith(("late", "  NOT MET", "inconclusive", "fail", "pass")):
                print("    " + line)
        return ended.returncode, json.loads((run / "summary.json").read_text("utf-8"))


def main() -> int:
    """Fly several times and print each verdict; return 1 where one is not as it must be."""
    parser = argparse.ArgumentParser(prog="python -m tests.host_load", description=__doc__)
    parser.add_argument("--runs", type=int, default=3)
    parser.add_argument("--loops", type=int, default=2 * (os.cpu_count() or 1))
    parser.add_argument("arguments", nargs="+", help="of qswarm run, after --")
    options = parser.parse_args()
    wrong = 0
    for seed in range(options.runs):
        status, found = flown([*options.arguments, "--seed", str(seed)], options.loops)
        late = found["late_tick_fraction"]
        too_slow = late is not None and late >= 0.01
        unsafe = found["invariants"]["I1"]["violations"] > 0
        as_wanted = status == 3 if too_slow and not unsafe else True
        wrong += not as_wanted
        print(f"seed {seed}: {found['outcome']}, late {late:.1%}, I1 {unsafe}, status {status}")
    return min(wrong, 1)


if __name__ == "__main__":
    sys.exit(main())
