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
    """Return the steps of all events in order of time; at one time, ends before beginnings."""
    begun = [Step(event.at_s, i, event, False) for i, event in enumerate(scenario.event)]
    ended = [
        Step(_sum(event.at_s, event.for_s), i, event, True)
        for i, event in enumerate(scenario.event)
        if event.for_s is not None
    ]
    return sorted(begun + ended, key=lambda step: (step.at_s, not step.ends, step.number))


class Timeline:
    """The steps of a scenario's events and of the operator's events, in order of time."""

    def __init__(self, scenario: Scenario) -> None:
        self._steps = steps(scenario)
        self._next = 0
        self._number = len(scenario.event)

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

    def end_later(self, begun: Step) -> None:
        """Add the end of an operator's event, where it has one."""
        if begun.event.for_s is not None:
            step = begun._replace(at_s=_sum(begun.at_s, begun.event.for_s), ends=True)
            insort(self._steps, step, lo=self._next, key=lambda each: each.at_s)


def _sum(at_s: float, for_s: float) -> float:
    """Return the time of an end [s] to the microsecond: 1.1 s and 2.2 s make 3.3 s, exactly."""
    return round(at_s + for_s, 6)
