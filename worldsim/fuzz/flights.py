"""Flights of scenarios at a site, each with its margins; nothing else is kept of them."""

import json
from collections.abc import Iterable, Iterator, Mapping
from typing import Any, NamedTuple

from netem.wire.shutdown import StopRequest
from worldsim.campaign.flight import FlightProbe
from worldsim.campaign.flight_site import FlightSite, Order
from worldsim.campaign.flight_site import Flown as Shown
from worldsim.fuzz.probe import MARGINS_FILE, MarginProbe
from worldsim.scenario.tables import Scenario
from worldsim.search.margins import Margins, margins_of, of_error, of_repetition

AGAIN = "-again"
EVENTS_FILE = "events.jsonl"
WORK = "flights"
"""The folder of the flights at work on this host; it is gone between two runs."""


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
    different: int = 1
    """How many different traces its repetitions have."""


class Task(NamedTuple):
    """A flight to make."""

    name: str
    scenario: Scenario
    probe: FlightProbe | None = None
    flights: int = 1
    """How often it is flown; the traces are compared."""


class Hangar(NamedTuple):
    """Where flights are made: at a site, until a stop is requested."""

    site: FlightSite
    stop: StopRequest

    def fly(self, tasks: Iterable[Task]) -> Iterator[Flown]:
        """Yield what each flight showed, as they end; a flight that was cut off is left out.

        Raises SiteError where the site can fly no more, RunWriteError where its disk is full.
        """
        orders: list[Order] = []
        task_of: dict[str, Task] = {}
        made: dict[str, list[Flown]] = {}
        for task in tasks:
            of_task = list(_orders(task))
            orders += of_task
            task_of |= {order.key: task for order in of_task}
            made[task.name] = []
        for shown in self.site.fly(orders, self.stop) if orders else ():
            task = task_of[shown.key]
            flights = made[task.name]
            flights.append(_flown(shown, task))
            if len(flights) == task.flights:
                yield _compared(flights)

    @property
    def at_once(self) -> int:
        """How many flights are made at once."""
        return max(1, self.site.at_once())

    def stopped(self) -> bool:
        """Whether a stop was requested."""
        return self.stop.requested

    def measure(self, name: str, scenario: Scenario) -> Flown | None:
        """Return what a flight showed tick by tick; None where it was cut off."""
        return next(self.fly([Task(name, scenario, MarginProbe(scenario))]), None)


def _orders(task: Task) -> Iterator[Order]:
    wanted = (MARGINS_FILE, EVENTS_FILE) if isinstance(task.probe, MarginProbe) else ()
    for number in range(task.flights):
        yield Order(f"{task.name}{number * AGAIN}", task.scenario, task.probe, wanted)


def _flown(shown: Shown, task: Task) -> Flown:
    summary = shown.summary
    if summary is None:
        return Flown(task.name, of_error(), shown.reason, None)
    flown = Flown(task.name, margins_of(summary), summary["reason"], summary["trace_sha256"])
    if not shown.files:
        return flown
    lines = shown.files[EVENTS_FILE].decode("utf-8").splitlines()
    events = tuple(json.loads(line) for line in lines)
    return flown._replace(measured=json.loads(shown.files[MARGINS_FILE]), events=events)


def _compared(flights: list[Flown]) -> Flown:
    """Return what a flight showed, and whether its repetitions showed the same."""
    one = flights[0]
    if len(flights) == 1:
        return one
    different = len({each.trace for each in flights})
    return one._replace(margins=of_repetition(one.margins, different == 1), different=different)


def violated_s(flown: Flown, scenario: Scenario, name: str) -> float | None:
    """Return when a flight violated a property [s; simulated time]; None where it did not.

    A time limit is violated at the end of the flight.
    """
    if flown.margins.get(name, 1.0) >= 0.0:
        return None
    first_s = flown.measured["first_s"].get(name) if flown.measured else None
    return scenario.duration_s if first_s is None else float(first_s)
