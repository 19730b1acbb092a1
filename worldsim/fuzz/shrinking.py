"""Shrinking of a finding: smaller scenarios are flown, within a budget, that still violate it."""

import tomllib
from collections.abc import Callable
from functools import partial
from math import inf
from pathlib import Path
from typing import Final

from agent.config import Comms
from worldsim.fuzz.findings import (
    REPEAT,
    REPETITIONS,
    TIMED,
    Say,
    explanation,
    flights_for,
    keep,
    signature,
)
from worldsim.fuzz.flights import Flown, Hangar, Task, violated_s
from worldsim.fuzz.folder import ORIGINAL, SCENARIO, Row, read_finding
from worldsim.fuzz.probe import MarginProbe
from worldsim.fuzz.spelled_out import with_listed_start, with_named_agents
from worldsim.scenario.file import as_toml
from worldsim.scenario.tables import CONVERGED_M
from worldsim.search.drafts import cautions, loaded, objection
from worldsim.search.draws import Tables
from worldsim.search.shrink import Shrinker, Size, limit_s, quiet_from_s, tidy
from worldsim.search.trials import fair_s

BUDGET: Final = 150
"""Flights that shrink one finding at most."""
REST_S, REST_ROUNDS = 10.0, 12.0
"""A team that stood still out of its places for so long will not move in more time either [s]; nor
for so many rounds of news that get through."""


def shrink(folder: Path, hangar: Hangar, say: Say, budget: int = BUDGET) -> Row | None:
    """Make a finding's scenario smaller, and explain it; None where a stop was requested.

    A finding that cannot be replayed stays as it is.
    """
    finding, file = read_finding(folder), folder / SCENARIO
    name, tables = finding["property"], tomllib.loads(file.read_text(encoding="utf-8"))
    # The scenario may be smaller already, where shrinking was interrupted.
    drawn = tomllib.loads((folder / ORIGINAL).read_text(encoding="utf-8"))
    trials = _Trials(file, name, hangar, limit_s(drawn))
    first_s = trials.violated([tables])[0]
    if hangar.stopped():
        return None
    flights = 0
    if first_s is not None:
        tables, first_s = _spelled_out(tables, first_s, trials)
        shrinker = Shrinker(tables, first_s, timed=name in TIMED)
        while flights < budget and (batch := shrinker.batch(hangar.at_once)):
            found = trials.violated(batch)
            if hangar.stopped():
                return None
            flights += len(batch)
            if shrinker.take(zip(batch, found, strict=True)):
                file.write_text(as_toml(tidy(shrinker.smallest)), encoding="utf-8")
            say(f"shrinking {folder.name}: {flights} of {budget} flights, {_size(shrinker)}")
        tables = tidy(shrinker.smallest)
    finding |= {"shrunk": True, "shrink_flights": flights, "size": Size.of(tables)._asdict()}
    finding["signature"] = signature(name, tables)
    last = hangar.measure("last", loaded(as_toml(tables), file))
    if last is None:
        return None
    finding |= explanation(last, name, tables["duration_s"])
    keep(folder, finding)
    return finding


class _Trials:
    """Flies candidates for the scenario of a finding.

    file: the finding's scenario; drawn_s: the time limit that it was drawn with, None for none.
    """

    def __init__(self, file: Path, name: str, hangar: Hangar, drawn_s: float | None) -> None:
        self.file, self.hangar = file, hangar
        self._name, self._drawn_s = name, drawn_s

    def violated(self, batch: list[Tables]) -> list[float | None]:
        """Return when each candidate violates the property [s; simulated time].

        None where it does not, or cannot fly.
        """
        tasks, allowed = [], cautions(loaded(self.file.read_text("utf-8"), self.file))
        for number, tables in enumerate(batch):
            text = as_toml(tidy(tables))
            if not objection(text, self.file, allowed):
                scenario = loaded(text, self.file)
                probe, flights = MarginProbe(scenario), flights_for(self._name)
                tasks.append(Task(str(number), scenario, probe, flights))
        found: list[float | None] = [None] * len(batch)
        scenarios = {task.name: task.scenario for task in tasks}
        for flown in self.hangar.fly(tasks):
            at_s = violated_s(flown, scenarios[flown.name], self._name)
            tables = batch[int(flown.name)]
            if at_s is not None and self._name in TIMED:
                at_s = self._certain_s(flown, tables, at_s)
            if self._name == REPEAT and flown.different < REPETITIONS:
                at_s = None  # where two of so many are alike, two flights may not show it
            found[int(flown.name)] = at_s
        return found

    def _certain_s(self, flown: Flown, tables: Tables, at_s: float) -> float | None:
        """Return when it is certain that more time would not help [s]; None where it might.

        at_s: when the time allowed ran out, which counts where that time is fair, or the drawn one.
        """
        quiet_s, allowed_s = quiet_from_s(tables), limit_s(tables)
        if allowed_s is None or flown.measured is None:
            return at_s
        errors_m = [each for each in flown.measured["slot_error_m"] if each is not None]
        rested_s = max(float(flown.measured["rest_since_s"]), quiet_s) + rest_s(tables)
        if errors_m and errors_m[-1] > CONVERGED_M and rested_s <= quiet_s + allowed_s:
            return rested_s
        enough_s = fair_s(tables)
        if self._drawn_s is not None:
            enough_s = min(enough_s, self._drawn_s)
        return at_s if allowed_s >= enough_s else None


def rest_s(tables: Tables) -> float:
    """Return how long a team must stand still until it is certain that it waits for nothing [s]."""
    radio, usual = tables.get("netem") or {}, Comms()
    channels = (radio, radio.get("local") or {}, radio.get("multihop") or {})
    lost = max(float(each.get("loss_percent") or 0.0) for each in channels) / 100.0
    comms = {
        "multihop_hz": usual.multihop_hz,
        "local_hz": usual.local_hz,
        **tables.get("comms", {}),
    }
    hz = float(comms["multihop_hz"] or comms["local_hz"])
    return max(REST_S, REST_ROUNDS / (1.0 - lost) / hz) if lost < 1.0 else inf


def _spelled_out(tables: Tables, first_s: float, trials: _Trials) -> tuple[Tables, float]:
    """Return tables with what was drawn written out, and when they violate a property.

    What does not violate it any more when it is written out stays as it was drawn.
    """
    scenario = loaded(as_toml(tables), trials.file)
    flown = trials.hangar.measure("drawn", scenario)
    rows = flown.events if flown is not None else ()
    spells: tuple[Callable[[Tables], Tables], ...] = (
        partial(with_named_agents, rows=rows),
        partial(with_listed_start, scenario=scenario),
    )
    for spell in spells:
        spelled = spell(tables)
        if spelled != tables and (found_s := trials.violated([spelled])[0]):
            tables, first_s = spelled, found_s
    return tables, first_s


def _size(shrinker: Shrinker) -> str:
    size = Size.of(shrinker.smallest)
    return f"{size.faults} faults, {size.agents} agents, {size.duration_s:g} s"
