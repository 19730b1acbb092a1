"""`qswarm cause`: from when on a failure was certain, whatever comes after.

A flight is repeated up to a tick as it was; from there on the radio and the sensors draw other
numbers, and nothing further happens: no event begins, and no fault ends. The first tick from which
on 95 % of such flights fail is found by bisection. Beside it, the timeline is cut: the last event
without which nothing fails.
"""

import tomllib
from collections.abc import Callable, Sequence
from math import ceil
from pathlib import Path
from typing import Final, NamedTuple

from worldsim.fuzz.findings import TIMED, flights_for, keep
from worldsim.fuzz.flights import Hangar, Task
from worldsim.fuzz.folder import SCENARIO, Row, read_finding
from worldsim.fuzz.probe import Redraw
from worldsim.scenario.file import as_toml
from worldsim.scenario.tables import SLOTS_PER_TICK, Scenario
from worldsim.search.drafts import cautions, loaded, objection
from worldsim.search.draws import Tables
from worldsim.search.shrink import tidy

CERTAIN: Final = 0.95
STRIDE: Final = 7919
"""Between the seeds of two draws."""
Say = Callable[[str], None]


class Cause(NamedTuple):
    """When a failure became certain."""

    replays: bool
    """Whether the finding still fails."""
    certain_s: float | None = None
    """The first tick from which on it fails in 95 % of draws if nothing further happens [s]; None:
    not before it shows."""
    from_the_start: float | None = None
    """The share of other draws from the start on that fail too."""
    needed: Tables | None = None
    """The last event without which it does not fail; None: none is needed."""
    flights: int = 0

    @property
    def text(self) -> str:
        """The cause in words."""
        if not self.replays:
            return "The finding no longer fails: it is fixed, or this is another version."
        told = []
        if self.certain_s is None:
            told.append("Other draws avoid the failure up to the tick in which it shows.")
        elif self.certain_s == 0.0:
            told.append("Certain from the start, whatever radio and sensors draw.")
        else:
            told.append(f"Certain from {self.certain_s:g} s on, whatever comes after.")
        if (self.from_the_start or 0.0) < CERTAIN:
            share = f"{100.0 * (self.from_the_start or 0.0):.0f} %"
            told.append(f"With other draws from the start, {share} fail.")
        elif self.certain_s != 0.0:
            told.append("No draw matters.")
        if self.needed is None:
            told.append("It fails without any event.")
        else:
            rest = {key: value for key, value in self.needed.items() if key != "at_s"}
            told.append(f"It needs the event at {self.needed['at_s']:g} s: {rest}{self._ending}.")
        return " ".join(told)

    @property
    def _ending(self) -> str:
        """In words that the needed event ends; nothing where it is certain before."""
        event = self.needed or {}
        end_s = float(event.get("at_s", 0.0)) + float(event.get("for_s") or 0.0)
        ends = bool(event.get("for_s")) and (self.certain_s or 0.0) >= end_s
        return f", and its end at {end_s:g} s" if ends else ""


class _Prober:
    """Flies a finding's scenario with other draws, or with other events."""

    def __init__(self, folder: Path, hangar: Hangar, draws: int, say: Say) -> None:
        self.finding, self._file = read_finding(folder), folder / SCENARIO
        self.tables: Tables = tomllib.loads(self._file.read_text(encoding="utf-8"))
        self.scenario = loaded(as_toml(self.tables), self._file)
        self._hangar, self._draws, self._say = hangar, draws, say
        self.flights = 0

    def fails(self, tables: Tables) -> bool:
        """Return whether tables violate the finding's property."""
        scenario = self._of(tables)
        return scenario is not None and self._failed([self._task("0", scenario)]) == 1

    def share(self, tick: int) -> float:
        """Return the share of draws that fail, drawn anew from a tick on."""
        return self._share(
            tick, self.scenario, f"other draws from {self.seconds(tick):g} s on", None
        )

    def is_certain(self, tick: int) -> bool:
        """Return whether it fails whatever is drawn from a tick on, if nothing further happens."""
        scenario = self._of({**self.tables, "event": self._until(tick)})
        told = f"nothing but other draws from {self.seconds(tick):g} s on"
        spare = self._draws - ceil(CERTAIN * self._draws)
        return scenario is not None and self._share(tick, scenario, told, spare) >= CERTAIN

    @property
    def events(self) -> list[Tables]:
        """The events of the finding's scenario, in the order of their times."""
        return sorted(self.tables.get("event") or (), key=lambda each: float(each["at_s"]))

    def turns(self) -> list[int]:
        """Return the ticks in which an event begins, ends or comes again, and the first tick.

        In order. From where it has come again on it comes to the end, so later turns tell nothing.
        """
        begins = [self._tick(each["at_s"]) for each in self.events]
        again = [
            self._tick(each["at_s"] + each["every_s"]) for each in self.events if "every_s" in each
        ]
        return sorted({0, *begins, *again, *filter(None, map(self._end, self.events))})

    def _tick(self, at_s: float) -> int:
        """Return the first tick that can be another one because of what happens at a time [s]."""
        return ceil(float(at_s) * self.scenario.fleet.tick_hz - 1e-9)

    def _end(self, event: Tables) -> int | None:
        """Return the tick in which an event ends; None for one that does not."""
        return self._tick(event["at_s"] + event["for_s"]) if event.get("for_s") else None

    def _until(self, tick: int) -> list[Tables]:
        """Return what has happened by a tick: a fault that ends later lasts to the end.

        One that `qswarm check` does not let last for ever ends as it does. One that has happened
        again by then does so to the end.
        """
        kept: list[Tables] = []
        for event in self.events:
            if "every_s" in event and self._tick(event["at_s"] + event["every_s"]) <= tick:
                kept.append(event)
            elif self._tick(event["at_s"]) <= tick:
                once = _without(event, "every_s")
                lasting = _without(once, "for_s")
                goes_on = (self._end(event) or 0) > tick
                can = goes_on and self._of({**self.tables, "event": [*kept, lasting]}) is not None
                kept.append(lasting if can else once)
        return kept

    def seconds(self, tick: int) -> float:
        """Return the time of a tick [s]."""
        return tick / self.scenario.fleet.tick_hz

    def _share(self, tick: int, scenario: Scenario, told: str, spare: int | None) -> float:
        """Return the share of flights that fail. Once more than ``spare`` passed, it is enough."""
        failed = flown = 0
        while flown < self._draws and not self._hangar.stopped():
            count = min(max(self._hangar.at_once, 4), self._draws - flown)
            tasks = []
            for number in range(flown, flown + count):
                seed = (scenario.seed + STRIDE * (number + 1)) % 2**53
                redraw = Redraw(tick * SLOTS_PER_TICK, seed)
                tasks.append(self._task(str(number), scenario, redraw))
            failed += self._failed(tasks)
            flown += count
            self._say(f"{told}: {failed} of {flown} fail; {self.flights} flights so far")
            if spare is not None and flown - failed > spare:
                break
        return failed / max(flown, 1)

    def _of(self, tables: Tables) -> Scenario | None:
        """Return the scenario of tables; None where `qswarm check` objects to it."""
        text = as_toml(tidy(tables))
        if objection(text, self._file, cautions(self.scenario)):
            return None
        return loaded(text, self._file)

    def _task(self, name: str, scenario: Scenario, probe: Redraw | None = None) -> Task:
        return Task(name, scenario, probe, flights_for(self.finding["property"]))

    def _failed(self, tasks: list[Task]) -> int:
        name, found = self.finding["property"], list(self._hangar.fly(tasks))
        self.flights += len(found)
        return sum(flown.margins.get(name, 1.0) < 0.0 for flown in found)


def find_cause(folder: Path, hangar: Hangar, draws: int, say: Say) -> Cause | None:
    """Return the cause of a finding, and add it to its page; None where a stop was requested.

    Raises RunDirectoryError where the folder holds no finding, ScenarioError for its scenario.
    """
    prober = _Prober(folder, hangar, draws, say)
    if not prober.fails(prober.tables):
        return None if hangar.stopped() else Cause(False)
    from_start = prober.share(0)
    certain_s = _certain_s(prober, hangar, from_start >= CERTAIN)
    needed = _needed(prober)
    if hangar.stopped():
        return None
    cause = Cause(True, certain_s, from_start, needed, prober.flights)
    row: Row = {**cause._asdict(), "text": cause.text, "draws": draws}
    keep(folder, {**prober.finding, "cause": row})
    return cause


def _certain_s(prober: _Prober, hangar: Hangar, no_draw_matters: bool) -> float | None:
    """Return the first tick [s] from which on the failure is certain, by bisection."""
    last = _last_tick(prober.finding, prober.scenario)
    ticks: Sequence[int] = range(last + 1)
    if no_draw_matters:  # only an event can have made it certain
        ticks = prober.turns()
    low, high = -1, len(ticks) - 1
    if not prober.is_certain(ticks[high]):
        return None
    while high - low > 1 and not hangar.stopped():
        middle = (low + high) // 2
        if prober.is_certain(ticks[middle]):
            high = middle
        else:
            low = middle
    return prober.seconds(ticks[high])


def _last_tick(finding: Row, scenario: Scenario) -> int:
    """Return the tick in which a failure shows: the violation, or the end of the time allowed."""
    known = finding["property"] not in TIMED and finding["trouble_s"] is not None
    shown_s = finding["trouble_s"] if known else scenario.duration_s
    return max(1, int(shown_s * scenario.fleet.tick_hz))


def _needed(prober: _Prober) -> Tables | None:
    """Return the last event that the failure needs: what comes after it can be left out."""
    events = prober.events
    while events:
        last = events.pop()
        if not prober.fails({**prober.tables, "event": events}):
            return last
    return None


def _without(event: Tables, name: str) -> Tables:
    return {key: each for key, each in event.items() if key != name}
