"""What `qswarm fuzz` and `qswarm cause` make of ten planted bugs; prints the tables of docs.

    QSWARM_PURE=1 python -m tests.planted_figures find --out runs/planted
    QSWARM_PURE=1 python -m tests.planted_figures race --first 1000 2000 3000 --out runs/planted
    QSWARM_PURE=1 python -m tests.planted_figures cause --out runs/planted

A bug counts as found by a scenario that violates something with it and nothing without it. Flights
are kept in the folder: what was stopped goes on. They are to be new for each commit.
"""

import argparse
import json
import sys
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from hashlib import sha256
from math import ceil
from pathlib import Path
from statistics import median
from typing import Any, NamedTuple, TypeVar

import pytest

from netem.wire.shutdown import StopRequest, stop_requests
from tests.planted_bugs import (
    BESIDE,
    PLANTS,
    SHRINK_FLIGHTS,
    DifferenceProbe,
    Window,
    small_terms,
)
from worldsim.campaign.flight_site import LocalSite, Order
from worldsim.fuzz.cause import find_cause
from worldsim.fuzz.findings import begin, flights_for
from worldsim.fuzz.flights import WORK, Flown, Hangar, Task
from worldsim.fuzz.folder import SCENARIO, Row, read_finding
from worldsim.fuzz.fuzz import Drawn, drawn, generations, row_of, task_of
from worldsim.fuzz.shrinking import shrink
from worldsim.results.exit_status import FAIL, INTERRUPTED, PASS
from worldsim.results.progress_line import ProgressLine
from worldsim.scenario.tables import SLOTS_PER_TICK, Scenario
from worldsim.search.drafts import loaded
from worldsim.search.guide import Guide

_Flown = TypeVar("_Flown")
NEAR_S = 1.0
"""So near to a bug's trigger ``qswarm cause`` is to say that its failure is certain [s]."""


@contextmanager
def planted(name: str) -> Iterator[None]:
    """Plant a bug meanwhile; none for an empty name."""
    with pytest.MonkeyPatch.context() as patch:
        if name:
            PLANTS[name](patch)
        yield


class StoppedError(Exception):
    """A flight was cut off by Ctrl-C."""


def first_of(flown: Iterable[_Flown]) -> _Flown:
    """Return what the only flight showed. Raises StoppedError where it was cut off."""
    found = [*flown]
    if not found:
        raise StoppedError
    return found[0]


class Bench:
    """Flies trials with and without a bug, and remembers what they showed.

    folder: no other process may use it meanwhile, or flights end by errors that are no findings.
    """

    def __init__(self, folder: Path, stop: StopRequest) -> None:
        folder.mkdir(parents=True, exist_ok=True)
        self.folder = folder
        self.hangar = Hangar(LocalSite(1, folder / WORK), stop)
        self._file = folder / "flights.jsonl"
        lines = self._file.read_text("utf-8").splitlines() if self._file.exists() else []
        self._rows: dict[str, Row] = {row["key"]: row for row in map(json.loads, lines)}
        self.say = ProgressLine().update

    def fly(self, task: Task) -> Flown:
        """Return what a flight showed. Raises StoppedError where it was cut off."""
        return first_of(self.hangar.fly([task]))

    def row(self, name: str, trial: Drawn) -> Row:
        """Return what a trial showed with a bug planted; without one for an empty name."""
        text = trial.trial.text.partition("\n")[2]  # without its name
        flights = task_of(trial).flights
        key = sha256(f"{name} {flights} {text}".encode()).hexdigest()
        if key not in self._rows:
            self.say(f"{name or 'no bug'}: seed {trial.seed}; {len(self._rows)} flights")
            with planted(name):
                flown = self.fly(task_of(trial))
            row = {**row_of(trial, flown), "key": key, "plant": name}
            with self._file.open("a", encoding="utf-8") as file:
                file.write(json.dumps(row) + "\n")
            self._rows[key] = row
        return {**self._rows[key], "seed": trial.seed, "how": trial.how}

    def is_found(self, name: str, trial: Drawn) -> bool:
        """Return whether a trial violates something, and nothing without the bug."""
        return bool(self.row(name, trial)["violated"]) and not self.row("", trial)["violated"]


class First(NamedTuple):
    """The first trial of a search that finds a bug."""

    runs: int
    trial: Drawn | None  # None: not found in so many runs


def first_found(bench: Bench, name: str, seeds: range, guided: bool) -> First:
    """Return the first of some seeds that finds a bug, searched as ``qswarm fuzz`` does."""
    guide, terms, runs = Guide(seeds.start) if guided else None, small_terms(name), 0
    for generation in generations(seeds):
        trials = [drawn(terms, BESIDE, seed, guide) for seed in generation]
        for trial in trials:
            runs += 1
            if bench.is_found(name, trial):
                return First(runs, trial)
        if guide is not None:
            for trial in trials:
                guide.learn(trial.trial.genes, bench.row(name, trial)["score"])
    return First(runs, None)


def find(bench: Bench, names: list[str], seeds: range, budget: int) -> bool:
    """Find and shrink each bug; print a row for each; return whether all were found.

    A finding counts that violates the same property again, and nothing without the bug.
    """
    print("| bug | seed | violated | runs | as drawn | shrunk | share | replays | without |")
    print("|---|---|---|---|---|---|---|---|---|")
    found = []
    for name in names:
        first = first_found(bench, name, seeds, guided=True)
        if first.trial is None:
            print(f"| {name} | not found in {first.runs} | | | | | | | |", flush=True)
            continue
        folder = bench.folder / "findings" / name
        if not (folder / SCENARIO).exists():
            with planted(name):
                flown = bench.fly(task_of(first.trial))
            begin(folder, first.trial.trial.text, bench.row(name, first.trial), flown)
        if not read_finding(folder)["shrunk"]:
            with planted(name):
                shrink(folder, bench.hangar, bench.say, budget)
        finding = read_finding(folder)
        sizes = (finding["original_size"], finding["size"])
        shown = [f"{s['faults']}, {s['agents']}, {s['duration_s']:g} s" for s in sizes]
        share = f"{100.0 * sizes[1]['duration_s'] / sizes[0]['duration_s']:.0f} %"
        with_it, without = violated(bench, folder, name), violated(bench, folder, "")
        if finding["property"] in with_it and not without:
            found.append(finding)
        verdicts = [", ".join(each) or "nothing" for each in (with_it, without)]
        print(
            f"| {name} | {finding['seed']} ({finding['how']}) | {finding['property']} "
            f"| {first.runs} | {' | '.join(shown)} | {share} | {' | '.join(verdicts)} |",
            flush=True,
        )
    if found:
        faults, agents = ([each["size"][key] for each in found] for key in ("faults", "agents"))
        shares = [
            each["size"]["duration_s"] / each["original_size"]["duration_s"] for each in found
        ]
        print(
            f"medians: {median(faults):g} faults, {median(agents):g} agents, {median(shares):.0%}"
        )
    return len(found) == len(names)


def violated(bench: Bench, folder: Path, name: str) -> list[str]:
    """Return what a finding's scenario violates with a bug planted; without one for no name."""
    scenario = loaded((folder / SCENARIO).read_text("utf-8"), BESIDE)
    flights = flights_for(read_finding(folder)["property"])
    with planted(name):
        flown = bench.fly(Task("replay", scenario, flights=flights))
    return [key for key, margin in flown.margins.items() if margin < 0.0]


def race(bench: Bench, names: list[str], firsts: list[int], most: int) -> None:
    """Print the runs to the first violation, guided and at random, for several first seeds."""
    shown = " ".join(map(str, firsts))
    print(f"| bug | random: first seed {shown} | median | guided | median |")
    print("|---|---|---|---|---|")
    medians: dict[bool, list[float]] = {False: [], True: []}
    for name in names:
        cells = []
        for guided, kept in medians.items():
            found = [first_found(bench, name, range(s, s + most), guided) for s in firsts]
            runs = [each.runs if each.trial else most + 1 for each in found]
            kept.append(median(runs))
            told = ", ".join(str(each) if each <= most else f"> {most}" for each in runs)
            cells.append(f"{told} | {kept[-1]:g}")
        print(f"| {name} | {' | '.join(cells)} |", flush=True)
    of_random, of_guided = median(medians[False]), median(medians[True])
    print(f"medians over the bugs: random {of_random:g}, guided {of_guided:g}")


def difference_s(bench: Bench, folder: Path, name: str) -> float | None:
    """Return when a bug first makes a difference in a finding's scenario [s; simulated time]."""
    scenario = loaded((folder / SCENARIO).read_text("utf-8"), BESIDE)
    order = Order("difference", scenario, DifferenceProbe(), (DifferenceProbe.FILE,))
    with planted(name):
        shown = first_of(bench.hangar.site.fly([order], bench.hangar.stop))
    at_s: float | None = json.loads(shown.files[DifferenceProbe.FILE])
    return at_s


class Harm(NamedTuple):
    """When a bug did what a finding's violation needs [s; simulated time]."""

    kept_away_s: float
    """The last tick from which on it must act; kept away for longer, it does no harm."""
    done_s: float
    """The first tick from which on it need not act any more; mended then, all is lost."""


def harm_of(bench: Bench, folder: Path, name: str) -> Harm:
    """Return when a bug did the harm in a finding's scenario, by mending it for a while."""
    scenario = loaded((folder / SCENARIO).read_text("utf-8"), BESIDE)
    ticks = ceil(scenario.duration_s * scenario.fleet.tick_hz)
    wanted = read_finding(folder)["property"]

    def fails(first: int, end: int | None) -> bool:
        bench.say(f"{name}: planted in ticks {first} to {end or ticks}")
        slots = None if end is None else end * SLOTS_PER_TICK
        window = Window(first * SLOTS_PER_TICK, slots)
        task = Task("harm", scenario, window, flights_for(wanted))
        flown = bench.fly(task)
        return flown.margins.get(wanted, 1.0) < 0.0

    with planted(name):
        kept_away = last_tick(ticks, lambda tick: fails(tick, None))
        saved = last_tick(ticks, lambda tick: not fails(0, tick))
    hz = scenario.fleet.tick_hz
    return Harm(kept_away / hz, (saved + 1) / hz)


def last_tick(ticks: int, holds: Callable[[int], bool]) -> int:
    """Return the last tick in which something holds that holds in tick 0.

    It goes back from the end in eighths of the flight to one that holds, and bisects after it.
    """
    low, high = 0, ticks
    for eighth in range(7, 0, -1):
        tick = eighth * ticks // 8
        if holds(tick):
            low = tick
            break
        high = tick
    while high - low > 1:
        middle = (low + high) // 2
        if holds(middle):
            low = middle
        else:
            high = middle
    return low


def trigger_s(scenario: Scenario, needed_s: float) -> float:
    """Return the last event, or end of one, up to when a bug must act; the start without one."""
    turns = [each.at_s for each in scenario.event]
    turns += [each.at_s + each.for_s for each in scenario.event if each.for_s]
    return max((each for each in turns if each <= needed_s), default=0.0)


def causes(bench: Bench, names: list[str]) -> None:
    """Print what made each bug do harm, and what ``qswarm cause`` says."""
    print(
        "| bug | violated at | first difference | must act from | trigger | harm done by "
        "| certain from | cause |\n|---|---|---|---|---|---|---|---|"
    )
    near = []
    for name in names:
        folder = bench.folder / "findings" / name
        scenario = loaded((folder / SCENARIO).read_text("utf-8"), BESIDE)
        first_s, harm = difference_s(bench, folder, name), harm_of(bench, folder, name)
        with planted(name):
            cause = find_cause(folder, bench.hangar, 20, bench.say)
        if cause is None:
            return
        trigger = trigger_s(scenario, harm.kept_away_s)
        certain_s = cause.certain_s
        near.append(certain_s is not None and abs(certain_s - trigger) <= NEAR_S)
        shown_s = read_finding(folder)["trouble_s"]
        times = (shown_s, first_s, harm.kept_away_s, trigger, harm.done_s, certain_s)
        print(f"| {name} | {' | '.join(map(str, times))} | {cause.text} |", flush=True)
    print(f"certain within {NEAR_S:g} s of the trigger: {sum(near)} of {len(near)}")


def main() -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("what", choices=("find", "race", "cause"))
    parser.add_argument("--out", type=Path, default=Path("runs/planted"))
    parser.add_argument("--only", nargs="+", choices=sorted(PLANTS))
    parser.add_argument("--first", nargs="+", type=int, default=[0], help="first seeds")
    parser.add_argument("--most", type=int, default=1000, help="seeds of a search at most")
    parser.add_argument("--budget", type=int, default=SHRINK_FLIGHTS, help="flights that shrink")
    given: Any = parser.parse_args()
    with stop_requests() as stop:
        try:
            return measured(Bench(given.out, stop), given)
        except StoppedError:
            print("stopped; the same command goes on", file=sys.stderr)
            return INTERRUPTED


def measured(bench: Bench, given: Any) -> int:
    """Measure what the command line asks for; return the exit status."""
    names = given.only or list(PLANTS)
    if given.what == "find":
        seeds = range(given.first[0], given.first[0] + given.most)
        return PASS if find(bench, names, seeds, given.budget) else FAIL
    if given.what == "race":
        race(bench, names, given.first, given.most)
    else:
        causes(bench, names)
    return PASS


if __name__ == "__main__":
    sys.exit(main())
