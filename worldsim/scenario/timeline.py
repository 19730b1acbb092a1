"""The timeline: which event begins or ends when. Pure; the same for every clock."""

from bisect import insort
from math import inf
from typing import NamedTuple

from worldsim.scenario.events import EventTable
from worldsim.scenario.tables import Scenario

SLACK_S = 1e-9


class Step(NamedTuple):
    """The beginning of an event, or its end."""

    at_s: float
    """[s; simulated time]"""
    number: int
    """The event's: its index in the scenario, or for an operator's event the next number."""
    event: EventTable
    ends: bool


def steps(scenario: Scenario) -> list[Step]:
    """Return the beginnings and ends of all events in the order in which they happen.

    At one time ends come before beginnings.
    """
    begun = [Step(event.at_s, i, event, False) for i, event in enumerate(scenario.event)]
    ended = [
        Step(event.at_s + event.for_s, i, event, True)
        for i, event in enumerate(scenario.event)
        if event.for_s is not None
    ]
    return sorted(begun + ended, key=lambda step: (step.at_s, not step.ends, step.number))


class Timeline:
    """A scenario's events in order of their times, and an operator's as they come."""

    def __init__(self, scenario: Scenario) -> None:
        self._steps = steps(scenario)
        self._next = 0
        self._number = len(scenario.event)

    @property
    def next_s(self) -> float:
        """When the next step is due [s]; infinite after the last."""
        return self._steps[self._next].at_s if self._next < len(self._steps) else inf

    @property
    def joiners(self) -> int:
        """How many agents are still to join by the events to come."""
        return sum(step.event.joiners for step in self._steps[self._next :] if not step.ends)

    def due(self, time_s: float) -> list[Step]:
        """Return the steps due by a time [s] that were not returned before, in order."""
        first = self._next
        while self.next_s <= time_s + SLACK_S:
            self._next += 1
        return self._steps[first : self._next]

    def begin_now(self, event: EventTable) -> Step:
        """Return the step of an operator's event, which begins at its ``at_s``, now."""
        self._number += 1
        return Step(event.at_s, self._number, event, False)

    def end_later(self, begun: Step) -> None:
        """Add the end of an operator's event, if it has one."""
        if begun.event.for_s is not None:
            step = begun._replace(at_s=begun.at_s + begun.event.for_s, ends=True)
            insort(self._steps, step, lo=self._next, key=lambda each: each.at_s)
