"""Findings: a failing seed kept as a scenario, explained, and flown again in later versions."""

import tomllib
from collections.abc import Callable
from pathlib import Path
from shutil import copytree
from typing import Any, Final

from worldsim.fuzz.flights import Flown, Hangar, Task
from worldsim.fuzz.folder import (
    FINDING,
    ORIGINAL,
    PAGE,
    SCENARIO,
    Row,
    findings_in,
    read_finding,
)
from worldsim.fuzz.pages import page
from worldsim.results.provenance import provenance
from worldsim.results.run_folder import write_json
from worldsim.scenario.tables import CONVERGED_M
from worldsim.scenario.toml import ScenarioError
from worldsim.search.drafts import loaded
from worldsim.search.draws import Tables
from worldsim.search.shrink import Size

TIMED: Final = ("converge", "reform")
"""Properties that are violated where a time runs out."""
ERROR: Final = "error"
REPEAT: Final = "repeat"
"""The property for which a scenario is flown several times."""
REPETITIONS: Final = 8
"""How often a finding of REPEAT is flown."""
POINTS: Final = 240
"""How many values of each margin a finding keeps at most."""
EVENTS: Final = 8
"""How many events before the trouble are kept."""
OF_TIMELINE: Final = ("slot", "queue", "role")
"""Kinds of events that are no fault, but what agents do."""
Say = Callable[[str], None]


def begin(folder: Path, text: str, row: Row, flown: Flown) -> Row:
    """Keep a failing seed as a finding that replays it; return what is known of it.

    row: the seed's line; flown: what its flight showed to a MarginProbe.
    """
    folder.mkdir(parents=True, exist_ok=True)
    for name in (ORIGINAL, SCENARIO):
        (folder / name).write_text(text, encoding="utf-8")
    size = Size.of(tomllib.loads(text))._asdict()
    finding: Row = {
        "name": folder.name,
        "property": row["violated"][0],
        "seed": row["seed"],
        "how": row["how"],
        "reason": row["reason"],
        "original_size": size,
        "size": size,
        "shrunk": False,
        "shrink_flights": 0,
        **explanation(flown, row["violated"][0], row["duration_s"]),
        "signature": signature(row["violated"][0], tomllib.loads(text)),
        "version": provenance()["version"],
        "commit": provenance()["commit"],
    }
    keep(folder, finding)
    return finding


def keep(folder: Path, finding: Row) -> None:
    """Write a finding and its page."""
    write_json(folder / FINDING, finding)
    (folder / PAGE).write_text(page(finding), encoding="utf-8")


def signature(name: str, tables: Tables) -> str:
    """Return what findings have in common that are taken for the same: property and actions."""
    spare = {"at_s", "for_s", "every_s", "name"}
    kinds = {key for event in tables.get("event") or () for key in event.keys() - spare}
    return " ".join([name, *sorted(kinds)])


def flights_for(name: str) -> int:
    """Return how often a scenario is flown that may violate a property."""
    return REPETITIONS if name == REPEAT else 1


def explanation(flown: Flown, name: str, duration_s: float) -> Row:
    """Return what a finding's flight tells: its trouble, the events before it, the margins."""
    measured = flown.measured or {}
    trouble_s = trouble_of(measured, name, duration_s)
    if name in TIMED and trouble_s is not None:
        disturbed = [each["t_s"] for each in flown.events if each["kind"] not in OF_TIMELINE]
        trouble_s = max([trouble_s, *disturbed])
    before = [each for each in flown.events if trouble_s is None or each["t_s"] <= trouble_s]
    faults = [each for each in before if each["kind"] not in OF_TIMELINE]
    return {
        "reason": flown.reason,
        "trouble_s": trouble_s,
        "rest_since_s": measured.get("rest_since_s") if name in TIMED else None,
        "last_event": faults[-1] if faults else None,
        "events": before[-EVENTS:],
        "margins": {
            name: thinned(rows) for name, rows in measured.items() if isinstance(rows, list)
        },
        "trace_sha256": flown.trace,
    }


def thinned(values: list[float | None]) -> list[float | None]:
    """Return at most POINTS values over the same time, each the least of its part."""
    parts = -(-len(values) // POINTS) or 1
    found: list[float | None] = []
    for first in range(0, len(values), parts):
        known = [each for each in values[first : first + parts] if each is not None]
        found.append(min(known, default=None))
    return found


def trouble_of(measured: Any, name: str, duration_s: float) -> float | None:
    """Return the first tick of trouble [s]: of the violation, or of the way to it.

    None where a flight does not tell: it ended by an error, or went another way the second time.
    Of a time that runs out it is the last tick in which all agents were in their slots; if they
    never were, the last in which the farthest agent still came nearer.
    """
    first_s = (measured.get("first_s") or {}).get(name)
    if first_s is not None:
        return float(first_s)
    if not measured or name in (ERROR, REPEAT):
        return None
    if name not in TIMED:
        return duration_s
    times, errors = measured.get("t_s") or [], measured.get("slot_error_m") or []
    known = [(t_s, each) for t_s, each in zip(times, errors, strict=True) if each is not None]
    in_place = [t_s for t_s, error_m in known if error_m <= CONVERGED_M]
    nearer = [t_s for t_s, error_m in known if error_m > known[-1][1] + CONVERGED_M]
    return float(max(in_place or nearer, default=0.0))


def refly(corpus: Path, hangar: Hangar, say: Say) -> dict[str, str]:
    """Fly every finding of a corpus; return its state by name: known or fixed."""
    states = {}
    tasks, wanted = [], {}
    for folder in findings_in(corpus):
        finding, file = read_finding(folder), folder / SCENARIO
        try:
            scenario = loaded(file.read_text(encoding="utf-8"), file)
        except (OSError, ScenarioError) as error:
            say(f"{folder}: {error}")
            continue
        tasks.append(Task(folder.name, scenario, flights=flights_for(finding["property"])))
        wanted[folder.name] = finding["property"]
    for flown in hangar.fly(tasks):
        violated = flown.margins.get(wanted[flown.name], 1.0) < 0.0
        states[flown.name] = "known" if violated else "fixed"
        say(f"{len(states)} of {len(tasks)} findings of the corpus flown again")
    return states


def take_in(folder: Path, corpus: Path) -> None:
    """Copy a new finding into a corpus."""
    target = corpus / folder.name
    if not target.exists():
        copytree(folder, target)
