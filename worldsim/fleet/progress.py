"""Reports from the world to the launcher during a run: regular progress, and long waits."""

import numpy as np

from worldsim.engine.step import SlotLoop
from worldsim.fleet.ipc import Progress
from worldsim.fleet.launcher_link import LauncherLink
from worldsim.judge.event_text import sentence
from worldsim.judge.run_events import (
    ControllerLogged,
    Killed,
    Left,
    QueueChanged,
    RoleChanged,
    RunEvent,
    SlotChanged,
)
from worldsim.scenario.tables import CONVERGED_M

REPORT_EVERY_S = 0.25
STALL_AFTER_S = 2.0
MAX_EVENTS = 6
"""So many events are told at once."""


class ProgressReporter:
    """Reports progress, and what is done to the fleet, a few times a second of wall time."""

    def __init__(self, duration_s: float, loop: SlotLoop, launcher: LauncherLink) -> None:
        self._duration_s = duration_s
        self._loop = loop
        self._launcher = launcher
        self._report_at_s = 0.0
        self._events_seen = 0

    def report(
        self, elapsed_s: float, late_fraction: float | None, slowed_to: float | None = None
    ) -> None:
        """Report progress if it is due at ``elapsed_s``, the wall time since the start [s].

        late_fraction: share of late ticks; None under a clock that has none. slowed_to: speed of
        simulated time while it is below the requested one.
        """
        if elapsed_s >= self._report_at_s:
            self._report_at_s = elapsed_s + REPORT_EVERY_S
            self._report_events()
            factor = self._loop.world.time_s / elapsed_s if elapsed_s > 0.0 else None
            self._launcher.report_progress(self._progress(late_fraction, slowed_to, factor))

    def _report_events(self) -> None:
        """Report what was done to the fleet since the last report: faults, missions, returns."""
        events = self._loop.events
        told = [each for each in events[self._events_seen :] if _is_told(each)]
        self._events_seen = len(events)
        for event in told[:MAX_EVENTS]:
            self._launcher.report_notice(f"{event.t_s:.2f} s: {sentence(event)}")
        if len(told) > MAX_EVENTS:
            more = len(told) - MAX_EVENTS
            self._launcher.report_notice(f"and {more} more at that time: see events.jsonl")

    def _progress(
        self, late_fraction: float | None, slowed_to: float | None, factor: float | None
    ) -> Progress:
        figures = self._loop.figures
        faults = self._loop.effects.faults.all
        in_place = int(np.sum(figures.slot_error <= CONVERGED_M)) if figures is not None else 0
        return Progress(
            self._loop.world.time_s,
            self._duration_s,
            int(np.count_nonzero(self._loop.members.running)),
            in_place,
            self._loop.judge.min_separation_m,
            late_fraction,
            slowed_to,
            factor,
            self._loop.judge.phases[-1].formation.name,
            tuple(dict.fromkeys(each.kind for each in faults if each.to_s is None)),
        )


def _is_told(event: RunEvent) -> bool:
    """Return whether a person is told of an event while it happens.

    The agents' own choices are too many. The end of a process that the timeline ends, or that ends
    by itself, the launcher tells.
    """
    if isinstance(event, Killed | Left):
        return event.by is not None or event.nobody is not None
    return not isinstance(event, SlotChanged | QueueChanged | RoleChanged | ControllerLogged)


class StallReporter:
    """Reports one wait of a run, once, when it has lasted STALL_AFTER_S."""

    def __init__(self, waiting_for: str, launcher: LauncherLink) -> None:
        self._waiting_for = waiting_for
        self._launcher = launcher
        self._waited_s = 0.0

    def add_wait(self, more_s: float) -> None:
        """Add ``more_s`` [s] to the wait."""
        before_s = self._waited_s
        self._waited_s += more_s
        if before_s < STALL_AFTER_S <= self._waited_s:
            self._launcher.report_stall(self._waiting_for)
