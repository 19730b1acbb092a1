"""Every fault that a team must withstand, each with its bound, on many seeds.

``python -m tests.fault_rows --seeds 0:20`` flies nine agents through each row of ROWS in virtual
time, and prints how many seeds passed, the worst time to re-form and the least separation.
``--processes`` flies real processes instead. A flight passes as any run does: each bound is met,
no invariant is broken, and each fault struck something. Exit status 1 if a flight did not pass.
"""

import argparse
import json
import subprocess
import sys
from collections.abc import Iterator
from fnmatch import fnmatch
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

from netem.wire.shutdown import StopRequest
from worldsim.campaign.pool import Job, sweep
from worldsim.results.overall import Result
from worldsim.scenario.file import dump, load
from worldsim.scenario.library import find_scenario
from worldsim.scenario.tables import Scenario

BASE = "wedge-9"
CLEAN, BAD_S = "", 12.2 + 2.0 * 13.7
"""T_d + 2B of nine agents at one hop, with the radio of LOSSY [s]."""
LOSSY = "loss_percent = 50\ndelay_ms = 200\njitter_ms = 40"
AT_S = 15.0
NOT_STRUCK = ("number", "kind", "from_s", "to_s", "by", "process")
"""Keys of a fault's row in summary.json that count nothing."""
QSWARM = [sys.executable, "-c", "from worldsim.commands.app import main; main()"]


class Row(NamedTuple):
    """A fault with its bound."""

    name: str
    events: tuple[str, ...]
    """Tables of events, as in a scenario file."""
    within_s: float
    """The team must have re-formed so long after each change [s]."""
    radio: str = CLEAN
    lasts_s: float = 40.0
    """The duration of the flight [s]."""
    converges_s: float = 12.0
    more: tuple[tuple[str, str], ...] = ()
    """Further keys of the scenario and their values."""


def at(action: str, from_s: float = AT_S, for_s: float | None = None, more: str = "") -> str:
    """Return an event's table."""
    lasts = "" if for_s is None else f", for_s = {for_s}"
    return f"{{ at_s = {from_s}{lasts}, {action}{more} }}"


def partition(kind: str) -> str:
    """Return a partition of a kind that lasts 30 s."""
    bridge = ", bridge = [4]" if kind == "bridge" else ""
    groups = "[[0, 1, 2, 3, 5, 6, 7, 8, 4]]" if kind == "ring" else "[[0, 1, 2, 3], [5, 6, 7, 8]]"
    action = f"partition = {{ kind = '{kind}', groups = {groups}{bridge} }}"
    return at(action, for_s=30.0)


def radio(keys: str, for_s: float = 30.0) -> str:
    """Return a change of the radio."""
    return at(f"netem = {{ {keys} }}", for_s=for_s)


def clock(offset_s: float, from_s: float) -> str:
    """Return a wrong clock that lasts 15 s."""
    return at(f"clock = {{ {ONE}, offset_s = {offset_s} }}", from_s, 15.0)


def slow(delay_s: float, from_s: float = AT_S) -> str:
    """Return a slow controller that lasts 15 s."""
    return at(f"slow = {{ {ONE}, delay_s = {delay_s} }}", from_s, 15.0)


def starved(agents: str, from_s: float = AT_S) -> str:
    """Return a starvation that lasts 15 s."""
    return at(f"starve = {{ agents = {agents}, cpu_percent = 20 }}", from_s, 15.0)


def sabotage(kind: str, more: str = "") -> str:
    """Return sabotage of two agents' radios, from before the team forms."""
    return at(f"sabotage = {{ kind = '{kind}', agents = ['random:2']{more} }}", 1.0, 35.0)


def sensors(mode: str) -> str:
    """Return a failure of two agents' sensors that lasts 15 s, from before the team forms."""
    return at(f"sensor = {{ agents = ['random:2'], mode = '{mode}' }}", 2.0, 15.0)


ONE = "agents = ['random:1']"
KEPT = (("expect.in_formation_fraction", "1.0"),)
"""Nobody leaves its place once the team has formed."""
LONG: dict[str, Any] = {"radio": LOSSY, "lasts_s": 130.0, "converges_s": 60.0}
ROWS = (
    Row("a follower leaves", (at("leave = [8]"),), 10.0),
    Row("kill -9 of a follower, its vehicle hovers", (at("kill = [8]"),), 10.0),
    Row("a vertex agent leaves", (at("leave = ['vertex:V1']"),), 10.0),
    Row("a vertex agent leaves, lossy", (at("leave = ['vertex:V1']", 60.0),), 10.0, **LONG),
    Row("kill -9 of a vertex agent", (at("kill = ['vertex:V1']"),), 15.0),
    Row("kill -9 of a vertex agent, lossy", (at("kill = ['vertex:V1']", 60.0),), 15.0, **LONG),
    Row("SIGSTOP for 0.1 s", (at("pause = ['random:2']", for_s=0.1),), 5.0),
    Row("SIGSTOP for 3 s", (at("pause = ['random:2']", for_s=3.0),), 10.0, lasts_s=50.0),
    Row("SIGSTOP for 20 s", (at("pause = ['random:2']", for_s=20.0),), 15.0, lasts_s=60.0),
    Row("restart", (at("kill = ['random:1']", for_s=8.0),), 15.0, lasts_s=50.0),
    Row("restart, lossy", (at("kill = ['random:1']", 60.0, 8.0),), 5.0 + BAD_S, **LONG),
    Row(
        "two join and two leave",
        (at("join = 2"), at("leave = ['random:2']", 25.0)),
        15.0,
        lasts_s=50.0,
    ),
    *(
        Row(f"partition, {kind}", (partition(kind),), 15.0, lasts_s=75.0)
        for kind in ("clean", "one_way", "bridge", "ring")
    ),
    *(
        Row(
            f"flap, {period_s} s",
            (at(f"flap = {{ period_s = {period_s} }}", for_s=30.0),),
            15.0,
            lasts_s=65.0,
        )
        for period_s in (1.0, 10.0)
    ),
    Row("80 % loss", (radio("loss_percent = 80"),), 30.0, lasts_s=80.0),
    Row(
        "bursts",
        (radio("gemodel = { p_percent = 5, r_percent = 10, loss_bad_percent = 100 }"),),
        30.0,
        lasts_s=80.0,
    ),
    Row(
        "2 s of delay, jitter, reordering",
        (radio("delay_ms = 2000, jitter_ms = 500, reorder_percent = 25"),),
        30.0,
        lasts_s=80.0,
    ),
    Row("duplicates", (radio("duplicate_percent = 30"),), 10.0, lasts_s=60.0),
    Row("corruption", (radio("corrupt_percent = 30"),), 15.0, lasts_s=60.0),
    Row("a slow radio", (radio("rate_kbit = 100, limit = 20"),), 30.0, lasts_s=80.0),
    *(
        Row(f"a clock off by {offset_s:g} s{name}", (clock(offset_s, begins_s),), 15.0, **terms)
        for offset_s in (3.0, -3.0, 100.0)
        for name, begins_s, terms in (("", AT_S, {"lasts_s": 50.0}), (", lossy", 60.0, LONG))
    ),
    Row(
        "a clock that drifts",
        (at(f"clock = {{ {ONE}, drift_ppm = 10000 }}", for_s=30.0),),
        15.0,
        lasts_s=65.0,
    ),
    *(
        Row(f"a pose, {name}", (at(f"pose = {{ {ONE}, {keys} }}", for_s=15.0),), 15.0, lasts_s=50.0)
        for name, keys in (
            ("on another's place", "bias_m = [-0.577, 0.577, 0.577]"),
            ("5 m off", "bias_m = [5, 0, 0]"),
            ("noisy and turned", "noise_m = 0.3, bias_yaw_deg = 30"),
        )
    ),
    Row(
        "a pose on another's place, lossy",
        (at(f"pose = {{ {ONE}, bias_m = [-0.577, 0.577, 0.577] }}", 60.0, 15.0),),
        15.0,
        **LONG,
    ),
    *(
        Row(f"slow by {delay_s:g} s a step", (slow(delay_s),), 15.0, lasts_s=50.0)
        for delay_s in (0.05, 0.2, 2.0)
    ),
    Row("slow by 0.2 s a step, lossy", (slow(0.2, 60.0),), 15.0, **LONG),
    Row("one starved, 20 %", (starved("['random:1']"),), 15.0, lasts_s=50.0),
    Row("all starved, 20 %", (starved("['all']"),), 15.0, lasts_s=50.0),
    Row("all starved, 20 %, lossy", (starved("['all']", 60.0),), 15.0, **LONG),
    *(
        Row(kind, (sabotage(kind),), 10.0, more=KEPT)
        for kind in ("replay", "spoof", "garbage", "flood")
    ),
    *(
        Row(f"{kind}, lossy", (sabotage(kind),), 10.0, LOSSY, 60.0, 30.0, KEPT)
        for kind in ("replay", "spoof", "garbage", "flood")
    ),
    Row(
        "a flood on a slow radio",
        (radio("rate_kbit = 50, limit = 20"), sabotage("flood", ", per_s = 400")),
        30.0,
        lasts_s=80.0,
    ),
    Row(
        "10 000 messages a second on each key",
        (at("intruder = { agents = ['random:1'] }", 1.0, 30.0),),
        10.0,
        more=KEPT,
    ),
    Row("an intruder without a password", (at("intruder = {}", 1.0, 30.0),), 10.0, more=KEPT),
    Row("netem killed for 3 s", (at("kill = ['netem']", for_s=3.0),), 10.0, lasts_s=45.0),
    Row("netem stopped for 3 s", (at("pause = ['netem']", for_s=3.0),), 10.0, lasts_s=45.0),
    Row("netem stopped for 13 s", (at("pause = ['netem']", for_s=13.0),), 10.0, lasts_s=50.0),
    Row(
        "the world stopped for 5 s",
        (at("pause = ['world']", for_s=5.0),),
        10.0,
    ),
    *(
        Row(f"sensors {mode}", (sensors(mode),), 15.0, lasts_s=50.0, converges_s=32.0)
        for mode in ("silent", "stuck", "wrong")
    ),
    Row(
        "a jam",
        (at("jam = { centre_m = [0, 0, 0], radius_m = 3 }", for_s=15.0),),
        15.0,
        lasts_s=50.0,
    ),
)


def scenario_of(row: Row, seed: int) -> Scenario:
    """Return a row's flight."""
    overrides = {
        "seed": str(seed),
        "duration_s": str(row.lasts_s),
        "event": f"[{', '.join(row.events)}]",
        "expect.converge_within_s": str(row.converges_s),
        "expect.reform_within_s": str(row.within_s),
        "fleet.spare": "2",
        **{f"netem.{key.strip()}": value for key, value in _pairs(row.radio)},
        **dict(row.more),
    }
    return load(find_scenario(BASE), overrides)


def _pairs(lines: str) -> Iterator[tuple[str, str]]:
    for line in lines.splitlines():
        key, _, value = line.partition("=")
        yield key, value.strip()


def virtual(flights: list[Scenario], folder: Path, jobs: int) -> list[dict[str, Any]]:
    """Return the summaries of flights in virtual time."""
    made = sweep(
        [Job(each, folder / str(n), recording=False) for n, each in enumerate(flights)],
        jobs,
        StopRequest(),
    )
    return [dict(each.summary) if isinstance(each, Result) else {"error": each} for each in made]


def processes(flights: list[Scenario], folder: Path) -> list[dict[str, Any]]:
    """Return the summaries of flights of real processes, one after the other."""
    found = []
    for n, flight in enumerate(flights):
        file, out = folder / f"{n}.toml", folder / str(n)
        file.write_text(dump(flight), "utf-8")
        words = (*QSWARM, "run", file, "--out", out, "--no-recording")
        made = subprocess.run(words, check=False, capture_output=True, text=True)
        summary = out / "summary.json"
        error = {"error": made.stderr or made.stdout}
        found.append(json.loads(summary.read_text()) if summary.exists() else error)
    return found


def line_of(row: Row, summaries: list[dict[str, Any]]) -> tuple[str, bool]:
    """Return a row of the table, and whether every flight passed."""
    passed = sum(each.get("outcome") == "pass" for each in summaries)
    known = [each for each in summaries if "outcome" in each]
    times = [r["reformed_s"] for each in known for r in each["recoveries"]]
    worst = "never" if None in times else f"{max(times, default=0.0):.1f} s"
    distances = [each["min_separation_m"] for each in known]
    least = f"{min(distances):.3f} m" if distances else "-"
    effects = sorted({_effect(fault) for each in known for fault in each["faults"]})
    reasons = sorted({str(each.get("reason", each.get("error"))) for each in summaries} - {"None"})
    why = f" {'; '.join(reasons)[:300]}" if passed < len(summaries) else ""
    bound = f"{row.within_s:g} s"
    cells = (row.name, f"{passed} of {len(summaries)}", bound, worst, least)
    return f"| {' | '.join(cells)} | {', '.join(effects)} |{why}", passed == len(summaries)


def _effect(fault: dict[str, Any]) -> str:
    """Return what a fault struck: the counts of its row in summary.json that are not 0."""
    told = [key for key, value in fault.items() if value and key not in NOT_STRUCK]
    return f"{fault['kind']}: {' and '.join(told) or 'nothing'}"


def main() -> int:
    """Fly all rows, or those of a name, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("rows", nargs="*", default=["*"], help="names; * stands for any text")
    parser.add_argument("--seeds", default="0:20", help="first and last + 1")
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--processes", action="store_true")
    given = parser.parse_args()
    first, last = map(int, given.seeds.split(":"))
    print(
        "| fault | passed | bound | worst | least separation | struck |\n|---|---|---|---|---|---|"
    )
    good = True
    for row in ROWS:
        if not any(fnmatch(row.name, name) for name in given.rows):
            continue
        flights = [scenario_of(row, seed) for seed in range(first, last)]
        with TemporaryDirectory() as folder:
            place = Path(folder)
            made = (
                processes(flights, place)
                if given.processes
                else virtual(flights, place, given.jobs)
            )
        line, fine = line_of(row, made)
        print(line, flush=True)
        good = good and fine
    return 0 if good else 1


if __name__ == "__main__":
    sys.exit(main())
