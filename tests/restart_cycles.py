"""Cycles of kill -9 and restart of random agents: ``python -m tests.restart_cycles --cycles 300``.

Flies a fleet of processes with a crash loop, and reads the memory of world, netem and zygote, their
open files and threads, as it flies. It fails where an agent has no place RETURN_WITHIN_S after its
restart, a process is left, or memory grows from cycle to cycle. Run it by hand: 300 cycles take
four minutes. The router's allocator needs some 200 of them to settle. Exit status 1 if something is
wrong, 3 if the host was too slow to say.
"""

import argparse
import json
import re
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterable, Mapping
from math import inf
from operator import itemgetter
from pathlib import Path
from typing import Any, NamedTuple

QSWARM = [sys.executable, "-c", "from worldsim.commands.app import main; main()"]
PARTS = ("world", "netem", "zygote")
SETTLED = 0.6
"""Growth is measured after this share of the cycles."""
INCONCLUSIVE = 3
"""The exit status of a run whose host was too slow."""
MOST_GROWTH_KB = 20.0
"""What a part may grow by in a cycle [kB]."""
FIRST_S = 5.0
"""When the first agent is killed [s]."""
RETURN_WITHIN_S = 12.0
"""An agent has a place so long after its restart, however soon others are killed meanwhile [s].

Of this, boot_s takes 1 s. In virtual time, with a kill every second, the longest of 6 500 took 8 s,
without loss and with 50 %.
"""
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
at_s = {first_s}
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


def flown_s(every_s: float, cycles: int) -> float:
    """Return how long a fleet flies for that many restarts that have time to return [s]."""
    return FIRST_S + every_s * cycles + RETURN_WITHIN_S


def scenario(every_s: float, cycles: int) -> str:
    """Return the text of a scenario with that many restarts, and time to return after them."""
    formation = Path(__file__).parents[1] / "deploy/formations/pyramidal-wedge.toml"
    return SCENARIO.format(
        first_s=FIRST_S,
        duration_s=flown_s(every_s, cycles),
        every_s=every_s,
        formation=formation,
    )


def without_place(found: Iterable[Mapping[str, Any]], duration_s: float) -> list[str]:
    """Return which restarts an agent had no place after, of those with time for it.

    Each event has its kind, agent and t_s, as in events.jsonl. An agent that is killed again sooner
    than RETURN_WITHIN_S, or whose run ends sooner, need not have one.
    """
    ends: dict[int, float] = {}
    claimed: dict[int, float] = {}
    missing = []
    for each in sorted(found, key=itemgetter("t_s"), reverse=True):
        agent, t_s = each["agent"], each["t_s"]
        until_s = t_s + RETURN_WITHIN_S
        if each["kind"] == "kill":
            ends[agent] = t_s
            claimed.pop(agent, None)
        elif each["kind"] == "slot" and each["place"] is not None:
            claimed[agent] = t_s
        elif (
            each["kind"] == "restart"
            and agent is not None  # a restart of nobody
            and until_s <= ends.get(agent, duration_s)
            and claimed.get(agent, inf) > until_s
        ):
            missing.append(f"agent {agent} has no place {RETURN_WITHIN_S:g} s after {t_s} s")
    return missing[::-1]


def problems(run: Path, samples: list[tuple[int, dict[str, Sample]]], cycles: int) -> list[str]:
    """Return what is wrong with a run that has ended, however slow the host was."""
    found = [f"an unplanned end: {each}" for each in events(run, "kill") if not each["planned"]]
    alive = [name for name, pid in pids(run).items() if Path(f"/proc/{pid}/cmdline").exists()]
    if alive:
        found.append(f"left: {', '.join(alive)}")
    settled = [each for each in samples if each[0] >= SETTLED * cycles]
    if not settled:
        return [*found, f"no sample after {SETTLED * cycles:g} restarts"]
    for name in PARTS:
        (first, before), (last, after) = settled[0], settled[-1]
        growth = (after[name].own_kb - before[name].own_kb) / max(1, last - first)
        print(f"{name}: {growth:+.1f} kB a cycle")
        if growth > MOST_GROWTH_KB or after[name].files > before[name].files + 1:
            found.append(f"{name} grows: {growth:.1f} kB a cycle, {after[name].files} files")
    return found


def lateness(run: Path, cycles: int, duration_s: float) -> list[str]:
    """Return what did not happen in time, which may be the host's doing."""
    late, restarts = events(run, "late"), events(run, "restart")
    found = [f"{len(late)} starts were late"] if late else []
    if len(restarts) < cycles:
        found.append(f"{len(restarts)} restarts of {cycles}")
    of_agents = [*events(run, "kill"), *restarts, *events(run, "slot")]
    return found + without_place(of_agents, duration_s)


def main() -> int:
    """Fly the cycles and print what they leave; return the exit status."""
    parser = argparse.ArgumentParser(prog="python -m tests.restart_cycles", description=__doc__)
    parser.add_argument("--cycles", type=int, default=300)
    parser.add_argument("--every", type=float, default=1.5, help="seconds from kill to kill")
    parser.add_argument("--speed", default="2")
    parser.add_argument("--recording", action="store_true")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        run, file = Path(folder) / "run", Path(folder) / "restarts.toml"
        duration_s = flown_s(options.every, options.cycles)
        file.write_text(scenario(options.every, options.cycles), "utf-8")
        command = [*QSWARM, "run", str(file), "--out", str(run), "--speed", options.speed]
        command += [] if options.recording else ["--no-recording"]
        with (Path(folder) / "output").open("wb") as output:
            process = subprocess.Popen(command, stdout=output, stderr=output, cwd=Path.cwd())
            samples = watched(process, run)
        print((Path(folder) / "output").read_text("utf-8")[-600:])
        found = problems(run, samples, options.cycles)
        late = lateness(run, options.cycles, duration_s)
    print("\n".join(found + late) or "as it must be")
    if found or not late:
        return 1 if found else 0
    return INCONCLUSIVE if process.returncode == INCONCLUSIVE else 1


if __name__ == "__main__":
    sys.exit(main())
