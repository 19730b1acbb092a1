"""The table of traces: ``trace_sha256`` of every scenario of the library, and of rougher flights.

A change that must not change behaviour leaves it equal:

    python -m tests.traces write before.json      # before the change
    python -m tests.traces compare before.json    # after it: exit 1 and the rows that differ

Traces are equal on one machine with the pinned versions, not between machines; so the table is
made anew for each change and is not kept.
"""

import argparse
import json
import subprocess
import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
LIBRARY = ROOT / "deploy" / "scenarios"
LOSSY = ("netem.loss_percent=50", "netem.delay_ms=200", "netem.jitter_ms=40")
SHORT_S = {"wedge-50": 15, "wedge-100": 6}
"""Fleets so large that their first seconds have to do [s]."""

CHAOS = """\
name = "chaos"
seed = 1
duration_s = 30.0
[fleet]
agents = 9
[formation]
file = "{library}/../formations/pyramidal-wedge.toml"
[netem]
range_m = 6.0
delay_ms = 20
jitter_ms = 5
loss_percent = 10
duplicate_percent = 1
reorder_percent = 1
corrupt_percent = 1
rate_kbit = 400
gemodel = {{ p_percent = 2, r_percent = 25 }}
[[event]]
at_s = 5.0
kill = ["vertex:V1"]
for_s = 4.0
[[event]]
at_s = 6.0
pause = ["random:2"]
for_s = 2.0
[[event]]
at_s = 8.0
jam = {{ centre_m = [0, 0, 0], radius_m = 0.5 }}
for_s = 2.0
[[event]]
at_s = 9.0
flap = {{ period_s = 1, links = [[0, 1], [1, 0]] }}
for_s = 4.0
[[event]]
at_s = 10.0
partition = [[0, 1, 2], [3, 4]]
for_s = 3.0
[[event]]
at_s = 11.0
netem = {{ loss_percent = 60 }}
for_s = 3.0
[[event]]
at_s = 12.0
sensor = {{ agents = [7], mode = "stuck" }}
for_s = 2.0
[[event]]
at_s = 15.0
kill = [3]
[[event]]
at_s = 17.0
restart = [3]
[[event]]
at_s = 19.0
join = 1
[[event]]
at_s = 21.0
leave = [4]
[expect]
converge_within_s = 30.0
"""


def flights(folder: Path) -> dict[str, list[str]]:
    """Return for each row of the table the words after ``qswarm``; folder: for files it needs."""
    chaos = folder / "chaos.toml"
    chaos.write_text(CHAOS.format(library=LIBRARY), encoding="utf-8")
    wedge = str(LIBRARY / "wedge-9.toml")
    lossy = [word for key in LOSSY for word in ("--set", key)]
    rows = {
        file.stem: ["sim", str(file), "--seed", "1", *_shortened(file.stem)]
        for file in sorted(LIBRARY.glob("*.toml"))
    }
    rows["wedge-9 at 50 %, 200 ms, 40 ms"] = ["sim", wedge, "--seed", "1", *lossy]
    for name, file, seconds in (("chaos", chaos, "30"), ("wedge-9", wedge, "12")):
        flight = [str(file), "--seed", "1", "--duration", seconds]
        rows[f"{name}, {seconds} s"] = ["sim", *flight]
        rows[f"{name} in lockstep"] = ["run", *flight, "--lockstep"]
        rows[f"{name} in lockstep, 2 mediums"] = ["run", *flight, "--lockstep", "--shards", "2"]
    return rows


def table() -> dict[str, str]:
    """Fly all rows, two at a time; return the trace of each."""
    with tempfile.TemporaryDirectory() as kept, ThreadPoolExecutor(2) as pool:
        folder = Path(kept)
        flown = {
            name: pool.submit(_trace, words, folder / str(number))
            for number, (name, words) in enumerate(flights(folder).items())
        }
        traces = {}
        for name, trace in flown.items():
            traces[name] = trace.result()
            print(f"{traces[name][:12]}  {name}", flush=True)
        return traces


def main() -> int:
    """Write the table, or compare it with one written before; return the exit status."""
    parser = argparse.ArgumentParser(prog="python -m tests.traces", description=__doc__)
    parser.add_argument("verb", choices=("write", "compare"))
    parser.add_argument("file", type=Path, help="the table, as JSON")
    options = parser.parse_args()
    before = {} if options.verb == "write" else json.loads(options.file.read_text())
    now = table()
    if options.verb == "write":
        options.file.write_text(json.dumps(now, indent=1) + "\n", encoding="utf-8")
        return 0
    changed = [name for name in before | now if before.get(name) != now.get(name)]
    print(f"{len(now) - len(changed)} of {len(now)} traces are equal")
    for name in changed:
        print(f"differs: {name}")
    return 1 if changed else 0


def _shortened(name: str) -> list[str]:
    return ["--duration", str(SHORT_S[name])] if name in SHORT_S else []


def _trace(words: list[str], out: Path) -> str:
    command = [
        sys.executable,
        "-c",
        "import sys; from worldsim.commands.app import main; sys.exit(main())",
    ]
    flown = subprocess.run(
        [*command, *words, "--no-recording", "--out", str(out)],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
    )
    if not (out / "summary.json").exists():
        raise RuntimeError(f"{' '.join(words)}: {flown.stdout}{flown.stderr}")
    trace: str = json.loads((out / "summary.json").read_text())["trace_sha256"]
    return trace


if __name__ == "__main__":
    sys.exit(main())
