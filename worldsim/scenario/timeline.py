"""The timeline: the steps of a scenario's events in time, the same for every clock."""

from bisect import insort
from math import inf
from typing import NamedTuple

from worldsim.scenario.events import EventTable
from worldsim.scenario.tables import Scenario

SLACK_S = 1e-9
"""Times closer than this are one time [s]."""


class Step(NamedTuple):
    """The beginning of an event, or its end."""

    at_s: float
    """[s; simulated time]"""
    number: int
    """The event's number: its index in the scenario; an operator's event gets the next one."""
    event: EventTable
    ends: bool
    """Whether the event ends; otherwise it begins."""


def steps(scenario: Scenario) -> list[Step]:
    """Return the steps of all events in order of time; at one time, ends before beginnings.

    A fault ends once: when its time is over, or when an event ends it before.
    """
    found = []
    ended = {event.end: event.at_s for event in scenario.event if event.end is not None}
    for number, event in enumerate(scenario.event):
        found.append(Step(event.at_s, number, event, False))
        ends_s = inf if event.for_s is None else _sum(event.at_s, event.for_s)
        ends_s = min(ends_s, ended.get(event.called(number), inf))
        if ends_s < inf:
            found.append(Step(ends_s, number, event, True))
    return sorted(found, key=lambda step: (step.at_s, not step.ends, step.number))


class Timeline:
    """The steps of a scenario's events and of the operator's events, in order of time."""

    def __init__(self, scenario: Scenario) -> None:
        self._steps = steps(scenario)
        self._next = 0
        self._number = len(scenario.event)
        self._events = dict(enumerate(scenario.event))
        """All events, the operator's so far too, by number."""

    @property
    def next_s(self) -> float:
        """When the next step is due [s; simulated time]; infinite after the last."""
        return self._steps[self._next].at_s if self._next < len(self._steps) else inf

    @property
    def joiners(self) -> int:
        """Number of agents that join by the events to come."""
        return sum(step.event.joiners for step in self._steps[self._next :] if not step.ends)

    def due(self, time_s: float) -> list[Step]:
        """Return the steps that became due by a time [s] since the last call, in order."""
        first = self._next
        while self.next_s <= time_s + SLACK_S:
            self._next += 1
        return self._steps[first : self._next]

    def begin_now(self, event: EventTable) -> Step:
        """Return the step of an operator's event, which begins now, at its ``at_s``."""
        self._number += 1
        return Step(event.at_s, self._number, event, False)

    def keep(self, begun: Step) -> None:
        """Add an operator's event that was carried out, and its end, where it has one."""
        self._events[begun.number] = begun.event
        if begun.event.for_s is not None:
            step = begun._replace(at_s=_sum(begun.at_s, begun.event.for_s), ends=True)
            insort(self._steps, step, lo=self._next, key=lambda each: each.at_s)

    def end_now(self, name: str, at_s: float) -> Step | None:
        """Return the step that ends the event of a name at a time [s]; None where there is none."""
        for number, event in self._events.items():
            if event.called(number) == name:
                return Step(at_s, number, event, True)
        return None

    def name_of(self, number: int) -> str:
        """Return the name of the event of a number."""
        return self._events[number].called(number)


def _sum(at_s: float, for_s: float) -> float:
    """Return the time of an end [s] to the microsecond: 1.1 s and 2.2 s make 3.3 s, exactly."""
    return round(at_s + for_s, 6)
