"""Flights of scenarios on the campaign's pool, each with its margins; no folder of them is kept."""

import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from shutil import rmtree
from typing import Any, NamedTuple

from netem.wire.shutdown import StopRequest
from worldsim.campaign.flight import FlightProbe
from worldsim.campaign.pool import Job, sweep
from worldsim.fuzz.probe import MARGINS_FILE, MarginProbe
from worldsim.results.overall import FailedRun, Made
from worldsim.results.run_folder import RunWriteError
from worldsim.scenario.tables import Scenario
from worldsim.search.margins import Margins, margins_of, of_error, of_repetition

AGAIN = "-again"
WORK = "flights"
"""The folder of the flights at work; it is empty between two runs."""


class Flown(NamedTuple):
    """What a flight showed."""

    name: str
    margins: Margins
    reason: str | None
    """Why it did not pass, in words."""
    trace: str | None
    measured: Mapping[str, Any] | None = None
    """What a MarginProbe saw."""
    events: tuple[Mapping[str, Any], ...] = ()
    """The rows of events.jsonl; only of a flight with a MarginProbe."""


class Task(NamedTuple):
    """A flight to make."""

    name: str
    scenario: Scenario
    probe: FlightProbe | None = None
    twice: bool = False
    """Whether it is flown twice, to compare the traces."""


class Hangar(NamedTuple):
    """Where flights are made: in a folder, so many at once, until a stop is requested."""

    folder: Path
    jobs: int
    stop: StopRequest

    def fly(self, tasks: list[Task]) -> Iterator[Flown]:
        """Yield what each flight showed, as they end; a flight that was cut off is left out.

        Raises RunWriteError where the disk is full.
        """
        work = self.folder / WORK
        rmtree(work, ignore_errors=True)  # of a search that was killed
        work.mkdir(parents=True)
        tasks_of = {task.name: task for task in tasks}
        jobs = [
            Job(each.scenario, work / f"{each.name}{end}", False, probe=each.probe)
            for each in tasks
            for end in (("", AGAIN) if each.twice else ("",))
        ]
        before: dict[str, Flown] = {}
        try:
            for made in sweep(jobs, self.jobs, self.stop) if jobs else ():
                task = tasks_of[made.folder.name.removesuffix(AGAIN)]
                flown = _flown(made, task)
                rmtree(made.folder, ignore_errors=True)
                if flown is None:
                    continue
                if not task.twice:
                    yield flown
                elif task.name in before:
                    yield _compared(before.pop(task.name), flown)
                else:
                    before[task.name] = flown
        finally:
            rmtree(work, ignore_errors=True)

    def stopped(self) -> bool:
        """Whether a stop was requested."""
        return self.stop.requested

    def measure(self, name: str, scenario: Scenario) -> Flown | None:
        """Return what a flight showed tick by tick; None where it was cut off."""
        return next(self.fly([Task(name, scenario, MarginProbe(scenario))]), None)


def _flown(made: Made, task: Task) -> Flown | None:
    if isinstance(made, FailedRun):
        if made.outcome == "inconclusive":
            raise RunWriteError(made.folder, made.error)
        return Flown(task.name, of_error(), made.error, None)
    summary = made.summary
    if summary["duration_s"] < task.scenario.duration_s - 1.0 / task.scenario.fleet.tick_hz:
        return None
    margins = margins_of(summary)
    if not isinstance(task.probe, MarginProbe):
        return Flown(task.name, margins, summary["reason"], summary["trace_sha256"])
    measured = json.loads((made.folder / MARGINS_FILE).read_text(encoding="utf-8"))
    lines = (made.folder / "events.jsonl").read_text(encoding="utf-8").splitlines()
    events = tuple(json.loads(line) for line in lines)
    return Flown(task.name, margins, summary["reason"], summary["trace_sha256"], measured, events)


def _compared(one: Flown, other: Flown) -> Flown:
    """Return what a flight showed, and whether it showed the same twice."""
    return one._replace(margins=of_repetition(one.margins, one.trace == other.trace))


def violated_s(flown: Flown, scenario: Scenario, name: str) -> float | None:
    """Return when a flight violated a property [s; simulated time]; None where it did not.

    A time limit is violated at the end of the flight.
    """
    if flown.margins.get(name, 1.0) >= 0.0:
        return None
    first_s = flown.measured["first_s"].get(name) if flown.measured else None
    return scenario.duration_s if first_s is None else float(first_s)
