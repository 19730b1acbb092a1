"""The timeline: the steps of a scenario's events in time, the same for every clock."""

from bisect import insort
from math import ceil, inf
from typing import NamedTuple

from msgspec.structs import replace

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


class Occurrence(NamedTuple):
    """One time at which an event of the scenario happens."""

    origin: int
    """The index of the event in the scenario."""
    event: EventTable
    """With its own time. One that repeats an event has that event's name."""


def occurrences(scenario: Scenario) -> dict[int, Occurrence]:
    """Return each time that an event happens, by number.

    Events have their index as number. The repetitions of those with ``every_s`` get the next ones.
    """
    found = {index: Occurrence(index, event) for index, event in enumerate(scenario.event)}
    ended = _ended_s(scenario)
    for index, event in enumerate(scenario.event):
        until_s = min(scenario.duration_s, ended.get(event.called(index), inf))
        for each in _repetitions(event, index, until_s):
            found[len(found)] = Occurrence(index, each)
    return found


def steps(scenario: Scenario) -> list[Step]:
    """Return the steps of all events in order of time; at one time, ends before beginnings.

    A fault ends once: when its time is over, or when an event ends it before.
    """
    found, ended = [], _ended_s(scenario)
    for number, (_, event) in occurrences(scenario).items():
        found += _steps_of(number, event, ended.get(event.called(number), inf))
    return _in_order(found)


def _steps_of(number: int, event: EventTable, ended_s: float = inf) -> list[Step]:
    """Return an event's beginning, and its end where it has one. ended_s: by another event [s]."""
    ends_s = inf if event.for_s is None else _sum(event.at_s, event.for_s)
    begins = Step(event.at_s, number, event, False)
    ends = Step(min(ends_s, ended_s), number, event, True)
    return [begins, ends] if ends.at_s < inf else [begins]


def _in_order(steps_: list[Step]) -> list[Step]:
    return sorted(steps_, key=lambda step: (step.at_s, not step.ends, step.number))


def _ended_s(scenario: Scenario) -> dict[str, float]:
    """Return when events end other ones, by their names [s]."""
    return {event.end: event.at_s for event in scenario.event if event.end is not None}


def _repetitions(event: EventTable, number: int, until_s: float) -> list[EventTable]:
    """Return an event's repetitions before a time [s]."""
    if event.every_s is None:
        return []
    count = ceil((until_s - event.at_s) / event.every_s - SLACK_S)
    return [
        replace(
            event,
            at_s=_sum(event.at_s, k * event.every_s),
            every_s=None,
            name=event.called(number),
        )
        for k in range(1, count)
    ]


class Timeline:
    """The steps of a scenario's events and of the operator's events, in order of time."""

    def __init__(self, scenario: Scenario) -> None:
        self._steps = steps(scenario)
        self._next = 0
        self._duration_s = scenario.duration_s
        self._events = {n: event for n, (_, event) in occurrences(scenario).items()}
        """All events, the operator's so far too, by number."""
        self._number = self._first_of_operator = len(self._events)

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
        """Return the step of an operator's event, which begins now, at its ``at_s``.

        Its number is the next one by which it has a name of its own.
        """
        self._number += 1
        while event.name is None and self.numbers_of(event.called(self._number)):
            self._number += 1
        return Step(event.at_s, self._number, event, False)

    def foreseen(self, begins: Step) -> list[Step]:
        """Return the steps to come if an operator's event begins now, its own with them.

        Its repetitions have numbers below 0.
        """
        own = _steps_of(begins.number, begins.event)
        for n, event in enumerate(_repetitions(begins.event, begins.number, self._duration_s)):
            own += _steps_of(-1 - n, event)
        return _in_order([*own, *self._steps[self._next :]])

    def keep(self, begun: Step) -> None:
        """Add an operator's event that was carried out: its end and repetitions, if it has any."""
        self._add(begun)
        for event in _repetitions(begun.event, begun.number, self._duration_s):
            step = self.begin_now(event)
            insort(self._steps, step, lo=self._next, key=lambda each: each.at_s)
            self._add(step)

    def _add(self, begins: Step) -> None:
        event = self._events[begins.number] = begins.event
        if event.for_s is not None:
            step = begins._replace(at_s=_sum(begins.at_s, event.for_s), ends=True)
            insort(self._steps, step, lo=self._next, key=lambda each: each.at_s)

    def numbers_of(self, name: str) -> list[int]:
        """Return the numbers of all events of a name: one, and its repetitions."""
        return [number for number, event in self._events.items() if event.called(number) == name]

    @property
    def names_to_come(self) -> set[str]:
        """The names of the events that are still to begin."""
        return {self.name_of(step.number) for step in self._steps[self._next :] if not step.ends}

    def cancel(self, name: str) -> None:
        """Let the events of a name begin no more; what has begun ends as before."""
        cancelled = set(self.numbers_of(name))
        self._steps[self._next :] = [
            step for step in self._steps[self._next :] if step.ends or step.number not in cancelled
        ]

    def end_now(self, number: int, at_s: float) -> Step:
        """Return the step that ends an event at a time [s]."""
        return Step(at_s, number, self._events[number], True)

    def ends_s(self, number: int) -> float | None:
        """Return when an event that has begun is to end [s; simulated time]; None: not planned."""
        to_come = self._steps[self._next :]
        return next((each.at_s for each in to_come if each.ends and each.number == number), None)

    def event_of(self, number: int) -> EventTable:
        """Return the event of a number."""
        return self._events[number]

    def is_operators(self, number: int) -> bool:
        """Return whether the event of a number is an operator's, or a repetition of one."""
        return number >= self._first_of_operator

    def name_of(self, number: int) -> str:
        """Return the name of the event of a number."""
        return self._events[number].called(number)


def _sum(at_s: float, for_s: float) -> float:
    """Return the time of an end [s] to the microsecond: 1.1 s and 2.2 s make 3.3 s, exactly."""
    return round(at_s + for_s, 6)
