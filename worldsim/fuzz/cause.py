"""`qswarm cause`: from when on a failure was certain, whatever is drawn from there on.

A flight is repeated up to a tick as it was; from there on the radio and the sensors draw other
numbers. The first tick from which on 95 % of such flights fail is found by bisection. Beside it,
the timeline is cut: the last event without which there is no failure. Draws that do not matter
leave only that.
"""

import tomllib
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, Final, NamedTuple

from worldsim.fuzz.findings import TIMED, keep
from worldsim.fuzz.flights import Hangar, Task
from worldsim.fuzz.folder import SCENARIO, Row, read_finding
from worldsim.fuzz.probe import Redraw
from worldsim.scenario.file import as_toml
from worldsim.scenario.tables import SLOTS_PER_TICK, Scenario
from worldsim.search.drafts import cautions, loaded, objection
from worldsim.search.draws import Tables

CERTAIN: Final = 0.95
STRIDE: Final = 7919
"""Between the seeds of two draws."""
Say = Callable[[str], None]


class Cause(NamedTuple):
    """When a failure became certain."""

    replays: bool
    """Whether the finding still fails."""
    certain_s: float | None = None
    """The first tick from which on it fails in 95 % of draws [s]; None: not before it shows."""
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
            told.append("No draw matters: it fails whatever radio and sensors draw.")
        else:
            share = f"{100.0 * (self.from_the_start or 0.0):.0f} %"
            told.append(
                f"Certain from {self.certain_s:g} s on; with other draws from the start, {share}"
                " fail."
            )
        if self.needed is None:
            told.append("It fails without any event.")
        else:
            rest = {key: value for key, value in self.needed.items() if key != "at_s"}
            told.append(f"It needs the event at {self.needed['at_s']:g} s: {rest}.")
        return " ".join(told)


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
        text = as_toml(tables)
        if objection(text, self._file, cautions(self.scenario)):
            return False
        return self._failed([Task("0", loaded(text, self._file))]) == 1

    def share(self, tick: int, least: float = 0.0) -> float:
        """Return the share of draws that fail, drawn anew from a tick on.

        Once it is certain that the share is below ``least``, the rest is not flown.
        """
        spare = self._draws - int(least * self._draws + 0.999)
        failed = flown = 0
        while flown < self._draws:
            count = min(max(self._hangar.at_once, 4), self._draws - flown)
            failed += self._failed([self._task(tick, flown + k) for k in range(count)])
            flown += count
            self._say(
                f"other draws from {tick / self.scenario.fleet.tick_hz:g} s on:"
                f" {failed} of {flown} fail; {self.flights} flights so far"
            )
            if self._hangar.stopped() or (least and flown - failed > spare):
                break
        return failed / flown

    def _task(self, tick: int, number: int) -> Task:
        seed = (self.scenario.seed + STRIDE * (number + 1)) % 2**53
        return Task(str(number), self.scenario, Redraw(tick * SLOTS_PER_TICK, seed))

    def _failed(self, tasks: Sequence[Task]) -> int:
        name, found = self.finding["property"], list(self._hangar.fly(list(tasks)))
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
    certain_s = 0.0 if from_start >= CERTAIN else _certain_s(prober, hangar)
    needed = _needed(prober)
    if hangar.stopped():
        return None
    cause = Cause(True, certain_s, from_start, needed, prober.flights)
    row: Row = {**cause._asdict(), "text": cause.text, "draws": draws}
    keep(folder, {**prober.finding, "cause": row})
    return cause


def _certain_s(prober: _Prober, hangar: Hangar) -> float | None:
    """Return the first tick [s] from which on the failure is certain, by bisection."""
    tick_hz = prober.scenario.fleet.tick_hz
    low, high = 0, _last_tick(prober.finding, prober.scenario)
    if prober.share(high, CERTAIN) < CERTAIN:
        return None
    while high - low > 1 and not hangar.stopped():
        middle = (low + high) // 2
        if prober.share(middle, CERTAIN) >= CERTAIN:
            high = middle
        else:
            low = middle
    return high / tick_hz


def _last_tick(finding: Row, scenario: Scenario) -> int:
    """Return the tick in which a failure shows: the violation, or the end of the time allowed."""
    timed = finding["property"] in TIMED
    shown_s = scenario.duration_s if timed else finding["trouble_s"]
    return max(1, int(shown_s * scenario.fleet.tick_hz))


def _needed(prober: _Prober) -> Tables | None:
    """Return the last event that the failure needs: what comes after it can be left out."""
    events: list[Any] = sorted(prober.tables.get("event") or (), key=lambda each: each["at_s"])
    kept = len(events)
    while kept:
        fewer = {**prober.tables, "event": events[: kept - 1]}
        if not prober.fails({key: value for key, value in fewer.items() if value != []}):
            return dict(events[kept - 1])
        kept -= 1
    return None
