"""Cycles of kill -9 and restart of random agents: ``python -m tests.restart_cycles --cycles 300``.

Flies a fleet of processes with a crash loop, and reads the memory of world, netem and zygote, their
open files and threads, as it flies. It fails where an agent did not come back, a process is left,
or memory grows from cycle to cycle. Run it by hand: 300 cycles take two minutes. The router's
allocator needs some 200 of them to settle.
"""

import argparse
import json
import re
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any, NamedTuple

QSWARM = [sys.executable, "-c", "from worldsim.commands.app import main; main()"]
PARTS = ("world", "netem", "zygote")
SETTLED = 0.6
"""Growth is measured after this share of the cycles."""
MOST_GROWTH_KB = 20.0
"""What a part may grow by in a cycle [kB]."""
SCENARIO = """
name = "restarts"
duration_s = {duration_s}
[fleet]
agents = 9
boot_s = 1.0
start = {{ kind = "box", centre_m = [0, 0, 0], size_m = [5, 5, 3], spacing_m = 0.6 }}
[formation]
file = "{formation}"
[netem]
range_m = 6.0
[[event]]
at_s = 5.0
for_s = 0.5
every_s = {every_s}
kill = ["random:1"]
[expect]
converge = false
"""
_FIELDS = re.compile(r"^(VmRSS|RssAnon|Threads):\s+(\d+)", re.MULTILINE)


class Sample(NamedTuple):
    """What a process holds."""

    resident_kb: int
    own_kb: int  # not of files
    threads: int
    files: int


def sample(pid: int) -> Sample:
    """Return what a process holds."""
    fields = dict(_FIELDS.findall(Path(f"/proc/{pid}/status").read_text("ascii")))
    files = len(list(Path(f"/proc/{pid}/fd").iterdir()))
    return Sample(int(fields["VmRSS"]), int(fields["RssAnon"]), int(fields["Threads"]), files)


def pids(run: Path) -> dict[str, int]:
    """Return the processes of a run by name."""
    rows = json.loads((run / "fleet.json").read_text("utf-8"))["processes"]
    return {row["name"]: row["pid"] for row in rows}


def events(run: Path, kind: str) -> list[dict[str, Any]]:
    """Return a run's events of a kind so far."""
    text = (run / "events.jsonl").read_text("utf-8") if (run / "events.jsonl").exists() else ""
    whole = text[: text.rfind("\n") + 1].splitlines()
    return [row for row in map(json.loads, whole) if row["kind"] == kind]


def watched(process: "subprocess.Popen[bytes]", run: Path) -> list[tuple[int, dict[str, Sample]]]:
    """Return the samples of a fleet by number of restarts, until it ends."""
    found: list[tuple[int, dict[str, Sample]]] = []
    while process.poll() is None:
        time.sleep(0.2)
        restarts = len(events(run, "restart")) if run.exists() else 0
        if restarts and (not found or restarts >= found[-1][0] + 5):
            try:
                now = {name: sample(pid) for name, pid in pids(run).items() if name in PARTS}
            except (FileNotFoundError, ProcessLookupError):
                continue
            found.append((restarts, now))
            print(f"{restarts:4} restarts: {_row(now)}", flush=True)
    return found


def _row(now: dict[str, Sample]) -> str:
    return "; ".join(
        f"{name} {each.own_kb / 1000:.1f} of {each.resident_kb / 1000:.1f} MB,"
        f" {each.threads} threads, {each.files} files"
        for name, each in now.items()
    )


def problems(run: Path, samples: list[tuple[int, dict[str, Sample]]], cycles: int) -> list[str]:
    """Return what is wrong with a run that has ended."""
    found = []
    kills, restarts = (events(run, kind) for kind in ("kill", "restart"))
    unplanned = [each for each in kills if not each["planned"]]
    if len(restarts) < cycles or unplanned:
        found.append(f"{len(restarts)} restarts of {cycles}, {len(unplanned)} unplanned ends")
    late = events(run, "late")
    if late:
        found.append(f"{len(late)} starts were late")
    claimed = {(e["agent"], e["t_s"]) for e in events(run, "slot") if e.get("place") is not None}
    for each in restarts[:-1]:
        again = [t_s for agent, t_s in claimed if agent == each["agent"] and t_s > each["t_s"]]
        if not again:
            found.append(f"agent {each['agent']} has no place after {each['t_s']} s")
    alive = [name for name, pid in pids(run).items() if Path(f"/proc/{pid}/cmdline").exists()]
    if alive:
        found.append(f"left: {', '.join(alive)}")
    settled = [each for each in samples if each[0] >= SETTLED * cycles]
    for name in PARTS:
        (first, before), (last, after) = settled[0], settled[-1]
        growth = (after[name].own_kb - before[name].own_kb) / max(1, last - first)
        print(f"{name}: {growth:+.1f} kB a cycle")
        if growth > MOST_GROWTH_KB or after[name].files > before[name].files + 1:
            found.append(f"{name} grows: {growth:.1f} kB a cycle, {after[name].files} files")
    return found


def main() -> int:
    """Fly the cycles and print what they leave; return 1 where something is wrong."""
    parser = argparse.ArgumentParser(prog="python -m tests.restart_cycles", description=__doc__)
    parser.add_argument("--cycles", type=int, default=300)
    parser.add_argument("--every", type=float, default=1.5, help="seconds from kill to kill")
    parser.add_argument("--speed", default="2")
    parser.add_argument("--recording", action="store_true")
    options = parser.parse_args()
    formation = Path(__file__).parents[1] / "deploy/formations/pyramidal-wedge.toml"
    with tempfile.TemporaryDirectory() as folder:
        run, file = Path(folder) / "run", Path(folder) / "restarts.toml"
        duration_s = 5.0 + options.every * options.cycles + 5.0
        every_s, cycles = options.every, options.cycles
        text = SCENARIO.format(duration_s=duration_s, every_s=every_s, formation=formation)
        file.write_text(text, "utf-8")
        command = [*QSWARM, "run", str(file), "--out", str(run), "--speed", options.speed]
        command += [] if options.recording else ["--no-recording"]
        with (Path(folder) / "output").open("wb") as output:
            process = subprocess.Popen(command, stdout=output, stderr=output, cwd=Path.cwd())
            samples = watched(process, run)
        print((Path(folder) / "output").read_text("utf-8")[-600:])
        found = problems(run, samples, cycles)
    print("\n".join(found) or "as it must be")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
