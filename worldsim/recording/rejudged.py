"""A recording judged again: the judge and the measurements of every tick, from the file alone.

The judge sees the rows that the run's judge saw, so its figures are those of the run.
"""

from collections.abc import Iterable
from typing import NamedTuple

from worldsim.judge.event import PlannedEvent
from worldsim.judge.run_events import RunEvent, WorldStopped
from worldsim.judge.tick import Tick
from worldsim.judge.verdict import Figures, Judge
from worldsim.recording.readback import Readback

EVENT_TIME_SLACK_S = 1e-6
"""Event times are rounded to the microsecond."""


class Rejudged(NamedTuple):
    """A recorded run, judged to its last tick."""

    judge: Judge
    figures: list[Figures]
    """What the judge measured at each tick, in the order of the ticks."""


def rejudge(readback: Readback) -> Rejudged:
    """Judge the recorded ticks and events in the run's order."""
    judge, noted, figures = Judge(readback.scenario), 0, []
    events = in_order(readback.events)
    for tick in readback.ticks:
        while noted < len(events) and _comes_before(events[noted], tick):
            judge.handle_event(events[noted])
            noted += 1
        figures.append(judge.see(tick))
    if any(isinstance(each, WorldStopped) and each.cause == "kill" for each in events[noted:]):
        for event in events[noted:]:  # the run ended between two ticks
            judge.handle_event(event)
    return Rejudged(judge, figures)


def in_order(events: Iterable[RunEvent]) -> list[RunEvent]:
    """Return recorded events in the order of their times."""
    return sorted(events, key=lambda event: event.t_s)


def _comes_before(event: RunEvent, tick: Tick) -> bool:
    """Return whether the run's judge took an event before a tick.

    At equal times a planned event comes before the tick, and an unplanned exit is noticed after it.
    """
    unplanned = isinstance(event, PlannedEvent) and not event.planned
    slack_s = -EVENT_TIME_SLACK_S if unplanned else EVENT_TIME_SLACK_S
    return event.t_s <= tick.time_s + slack_s
