"""`qswarm fuzz`: seeds drawn, flown and kept in generations; then its findings made small.

The seeds of a generation are drawn before any of them has flown, so that a result depends on the
seed and the generations before it, and not on the number of jobs. Even seeds are drawn at random,
odd ones so that margins fall (worldsim.search.guide).
"""

from collections.abc import Iterator, Mapping
from math import inf
from pathlib import Path
from time import monotonic
from typing import Any, Final, NamedTuple

from netem.wire.shutdown import stop_requests
from worldsim.campaign.flight_site import FlightSite, SiteError
from worldsim.fuzz.findings import begin, refly, take_in
from worldsim.fuzz.flights import Flown, Hangar, Task, violated_s
from worldsim.fuzz.folder import TABLE, Row, SearchFolder, findings_in, read_finding
from worldsim.fuzz.pages import closing, table
from worldsim.fuzz.probe import MarginProbe
from worldsim.fuzz.shrinking import BUDGET, shrink
from worldsim.results.exit_status import FAIL, INCONCLUSIVE, INTERRUPTED, INTERRUPTION, PASS
from worldsim.results.progress_line import ProgressLine
from worldsim.scenario.tables import Scenario
from worldsim.scenario.toml import ScenarioError
from worldsim.search.drafts import loaded, objection
from worldsim.search.guide import GENERATION, Guide
from worldsim.search.margins import (
    CONSERVATION,
    DISTANCES,
    LIVENESS,
    SAFETY,
    Margins,
    approached,
    score,
    violated,
)
from worldsim.search.trials import Terms, Trial, trial

WORD: Final = "fuzz"
"""The first word of every seed of numbers."""


TWICE_EVERY: Final = 8
"""Every so many seeds are flown twice, and the traces compared."""


class Search(NamedTuple):
    """What is searched, and how."""

    terms: Terms
    seeds: range
    folder: Path
    site: FlightSite
    """Where it is flown."""
    guided: bool
    """Whether odd seeds lower the margin."""
    shrinks: int
    """How many findings of each property are made small."""
    corpus: Path | None
    described: Mapping[str, Any]
    """What search.json says: what must be the same to go on."""
    beside: Path
    """The file whose folder the paths of the scenarios are relative to."""
    quiet: bool = False
    budget: int = BUDGET
    """Flights that shrink one finding at most."""
    first_only: bool = False
    """Whether the search ends with the generation of the first violation."""


class Drawn(NamedTuple):
    """A seed that was drawn."""

    seed: int
    how: str
    trial: Trial
    scenario: Scenario


def fuzz(search: Search) -> int:
    """Search for trouble; print findings and table; return the exit status.

    Raises RunDirectoryError for the folder of another search, before anything is flown.
    """
    folder, line = SearchFolder(search.folder), ProgressLine(hidden=search.quiet)
    states: dict[str, str] = {}
    lost = ""
    with folder.opened(search.described), stop_requests() as stop:
        hangar = Hangar(search.site, stop)
        try:
            if search.corpus is not None:
                states = refly(search.corpus, hangar, line.update)
            _fly(search, folder, hangar, line)
            _keep_findings(search, folder, hangar, line)
        except SiteError as error:
            lost = str(error)
    line.clear()
    rows = {seed: row for seed, row in sorted(folder.rows().items()) if seed in search.seeds}
    found = [read_finding(each) for each in findings_in(folder.path / "findings")]
    if search.corpus is not None:
        states |= _compared(found, folder, search.corpus)
    text = table(rows.values())
    (search.folder / TABLE).write_text(text + "\n", encoding="utf-8")
    told = _told(search, rows, found, states, text, stop.requested)
    for each in (*told, *([lost] if lost else [])):
        print(each)
    if stop.requested:
        return INTERRUPTED
    if lost:
        return INCONCLUSIVE
    failed = any(row["violated"] for row in rows.values()) or "known" in states.values()
    return FAIL if failed else PASS


def _fly(search: Search, folder: SearchFolder, hangar: Hangar, line: ProgressLine) -> None:
    """Fly the seeds that have no row yet."""
    rows, progress = folder.rows(), _Progress(search, line)
    guide = Guide(search.seeds.start) if search.guided else None
    for generation in generations(search.seeds):
        if hangar.stopped() or (search.first_only and _any_violated(rows, search.seeds)):
            break
        if guide is None and all(seed in rows for seed in generation):
            continue
        proposed = [drawn(search.terms, search.beside, seed, guide) for seed in generation]
        tasks = [task_of(each) for each in proposed if each.seed not in rows]
        of_seed = {each.seed: each for each in proposed}
        for flown in hangar.fly(tasks):
            row = row_of(of_seed[int(flown.name)], flown)
            rows[row["seed"]] = row
            folder.add(row)
            if row["violated"]:
                name = f"{row['violated'][0]}-{row['seed']}"
                begin(folder.finding(name), of_seed[row["seed"]].trial.text, row, flown)
            progress.show(rows)
        if guide is not None:
            for each in proposed:
                if each.seed in rows:
                    guide.learn(each.trial.genes, rows[each.seed]["score"])


def _any_violated(rows: Mapping[int, Row], seeds: range) -> bool:
    return any(rows[seed]["violated"] for seed in seeds if seed in rows)


def generations(seeds: range) -> Iterator[range]:
    """Yield the seeds that are drawn before any of them has flown."""
    for first in range(seeds.start, seeds.stop, GENERATION):
        yield range(first, min(first + GENERATION, seeds.stop))


def drawn(terms: Terms, beside: Path, seed: int, guide: Guide | None) -> Drawn:
    """Return the trial of a seed; guided where the seed is odd and there is a guide.

    beside: the file whose folder paths are relative to. Raises ScenarioError for terms of which
    nothing can be drawn.
    """
    guided = guide is not None and seed % 2 == 1

    def check(text: str) -> str:
        return objection(text, beside, terms.allowed)

    given: Any = guide.propose() if guide is not None and guided else {}
    name = f"{WORD}-{seed}"
    try:
        made = trial(name, (WORD, seed), terms, check, given)
    except LookupError as error:
        raise ScenarioError(name, "", str(error)) from error
    if guide is not None:
        guide.withdraw(given)
    how = "guided" if guided else "random"
    return Drawn(seed, how, made, loaded(made.text, beside))


def task_of(drawn: Drawn) -> Task:
    """Return the flight of a seed."""
    probe = MarginProbe(drawn.scenario)
    flights = 2 if drawn.seed % TWICE_EVERY == 0 else 1
    return Task(str(drawn.seed), drawn.scenario, probe, flights)


def _in_order(scenario: Scenario, flown: Flown) -> list[str]:
    """Return what was violated: the gravest kind first, of a kind what was violated first.

    A finding is about the first of them: an invariant is violated before a time runs out.
    """
    kinds = (SAFETY, CONSERVATION, LIVENESS)

    def order(name: str) -> tuple[int, float]:
        kind = next(number for number, names in enumerate(kinds) if name in names)
        at_s = violated_s(flown, scenario, name)
        return kind, inf if at_s is None else at_s

    return sorted(violated(flown.margins), key=order)


def row_of(drawn: Drawn, flown: Flown) -> Row:
    """Return the line of a seed."""
    scenario, bad = drawn.scenario, _in_order(drawn.scenario, flown)
    return {
        "seed": drawn.seed,
        "how": drawn.how,
        "violated": bad,
        "score": score(_flown_to(flown)),
        "margins": {name: round(value, 6) for name, value in flown.margins.items()},
        "reason": flown.reason,
        "violated_s": violated_s(flown, scenario, bad[0]) if bad else None,
        "agents": scenario.fleet.agents,
        "duration_s": scenario.duration_s,
        "events": len(scenario.event),
        "trace_sha256": flown.trace,
    }


def _flown_to(flown: Flown) -> Margins:
    """Return the margins of a flight without the distances that it only started with."""
    measured, margins = flown.measured or {}, flown.margins
    kept = [name for name in DISTANCES.values() if margins.get(name, -1.0) >= 0.0]
    return margins | {name: approached(measured[name]) for name in kept if measured.get(name)}


class _Progress:
    """Tells how far a search is, and how long the rest takes."""

    def __init__(self, search: Search, line: ProgressLine) -> None:
        self._search, self._line = search, line
        self._began_s, self._flown = monotonic(), 0

    def show(self, rows: Mapping[int, Row]) -> None:
        self._flown += 1
        seeds = self._search.seeds
        done = [rows[seed] for seed in seeds if seed in rows]
        bad = sum(bool(row["violated"]) for row in done)
        least = min(row["score"] for row in done)
        each_s = (monotonic() - self._began_s) / self._flown
        left_s = each_s * (len(seeds) - len(done))
        self._line.update(
            f"{len(done)} of {len(seeds)} seeds, {bad} with a violation, least score {least:.2f},"
            f" {left_s / 60.0:.0f} min left"
        )


def _keep_findings(
    search: Search, folder: SearchFolder, hangar: Hangar, line: ProgressLine
) -> None:
    """Make the first findings of each property small, those that are not yet."""
    small: dict[str, int] = {}
    folders = findings_in(folder.path / "findings")
    for each in sorted(folders, key=lambda one: int(read_finding(one)["seed"])):
        finding = read_finding(each)
        name = finding["property"]
        small[name] = small.get(name, 0) + 1
        if small[name] > search.shrinks or finding["shrunk"]:
            continue
        if hangar.stopped():
            return
        shrink(each, hangar, line.update, search.budget)


def _compared(found: list[Row], folder: SearchFolder, corpus: Path) -> dict[str, str]:
    """Return which findings are new; those are taken into the corpus."""
    states: dict[str, str] = {}
    seen = {read_finding(each)["signature"] for each in findings_in(corpus)}
    for finding in found:
        name = finding["name"]
        if not finding["shrunk"]:
            continue
        states[name] = "known" if finding["signature"] in seen else "new"
        if states[name] == "new":
            seen.add(finding["signature"])
            take_in(folder.finding(name), corpus)
    return states


def _told(
    search: Search,
    rows: Mapping[int, Row],
    found: list[Row],
    states: Mapping[str, str],
    text: str,
    stopped: bool,
) -> Iterator[str]:
    """Yield what is printed at the end."""
    yield text
    yield ""
    small = [each for each in found if each["shrunk"]]
    yield from closing(small, states)
    fixed = sorted(name for name, state in states.items() if state == "fixed")
    yield from (f"fixed: {name} of the corpus no longer fails" for name in fixed)
    if small:
        one = search.folder / "findings" / small[0]["name"]
        yield f"replay: qswarm sim {one}/scenario.toml    page: {one}/finding.md"
        yield f"cause:  qswarm cause {one}"
    missing = len(search.seeds) - len(rows)
    if missing:
        done = f"{len(rows)} of {len(search.seeds)} seeds done; the same command goes on"
        yield f"{INTERRUPTION}: {done}" if stopped else done
    elif stopped:
        yield f"{INTERRUPTION}: all seeds are done; the same command makes their findings small"
