"""How far a flight is, told now and then to whoever follows it; and what keeps it from going on."""

import numpy as np

from worldsim.engine.step import SlotLoop
from worldsim.fleet.launcher_link import LauncherLink, Progress
from worldsim.scenario.tables import CONVERGED_M

TELL_EVERY_S = 0.25
STANDSTILL_S = 2.0


class ProgressReporter:
    """Tells progress a few times a second of wall time."""

    def __init__(self, duration_s: float, loop: SlotLoop, launcher: LauncherLink) -> None:
        self._duration_s = duration_s
        self._loop = loop
        self._launcher = launcher
        self._tell_at_s = 0.0

    def tell(self, elapsed_s: float, late: float | None) -> None:
        """Tell how far it is, if it is time to; late: share of late ticks, where there can be."""
        if elapsed_s >= self._tell_at_s:
            self._tell_at_s = elapsed_s + TELL_EVERY_S
            self._launcher.progress(self._progress(late))

    def _progress(self, late: float | None) -> Progress:
        figures = self._loop.figures
        in_place = int(np.sum(figures.slot_error <= CONVERGED_M)) if figures is not None else 0
        return Progress(
            self._loop.world.time_s,
            self._duration_s,
            int(np.count_nonzero(self._loop.members.awake)),
            in_place,
            self._loop.judge.min_separation_m,
            late,
        )


class Standstill:
    """A wait for what has to come before a flight goes on; told once, when it has become long."""

    def __init__(self, what: str, launcher: LauncherLink) -> None:
        self._what = what
        self._launcher = launcher
        self._waited_s = 0.0

    def lasts(self, more_s: float) -> None:
        """Go on waiting, for ``more_s`` [s] more."""
        before_s = self._waited_s
        self._waited_s += more_s
        if before_s < STANDSTILL_S <= self._waited_s:
            self._launcher.waiting(self._what)
