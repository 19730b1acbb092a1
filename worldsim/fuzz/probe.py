"""What the search looks at in a flight: margins over time, and other draws from a slot on."""

import json
from collections.abc import Sequence
from math import dist, isfinite, isnan, nan
from pathlib import Path
from typing import Any, Final

import numpy as np

from agent.messages import Vector
from worldsim.engine.virtual import VirtualFleet
from worldsim.judge.metrics import ROUNDING_M
from worldsim.scenario.tables import SLOTS_PER_TICK, Scenario

MARGINS_FILE: Final = "margins.json"
REST_M: Final = 0.05
"""A vehicle that stays this near to where it is stands still [m]."""


class Rest:
    """Since when all vehicles of a flight stand still [s; simulated time]."""

    def __init__(self) -> None:
        self.since_s = 0.0
        self._stood: Sequence[Vector | None] = ()

    def see(self, positions: Sequence[Vector | None], t_s: float) -> None:
        """Take the positions at a time [m; world frame]; None for an absent vehicle."""
        if not self._stood or any(map(_moved, positions, self._stood)):
            self._stood, self.since_s = positions, t_s


def _moved(now: Vector | None, then: Vector | None) -> bool:
    if now is None or then is None:
        return now is not then
    return dist(now, then) > REST_M


class Redraw:
    """Lets a flight draw from another seed from a slot on: until then, all is as before."""

    def __init__(self, slot: int, seed: int) -> None:
        self._slot, self._seed = slot, seed

    def before_slot(self, fleet: VirtualFleet) -> None:
        """Change the seed in its slot."""
        if fleet.loop.world.slot == self._slot:
            fleet.redraw(self._seed)

    def write(self, folder: Path) -> None:
        """Write nothing: the summary says it all."""


class MarginProbe:
    """Keeps distances, the worst slot error, violations and rest of every tick of a flight."""

    def __init__(self, scenario: Scenario) -> None:
        self._separation_m = scenario.control.separation_m
        self._clearance_m = scenario.obstacle_bound_m
        self._rows: dict[str, list[float]] = {
            name: [] for name in ("t_s", "separation", "clearance", "slot_error_m")
        }
        self._violations: dict[str, int] = {}
        self._first_s: dict[str, float] = {}
        self._shown: Any = None
        self._rest = Rest()

    def before_slot(self, fleet: VirtualFleet) -> None:
        """Take the figures of a tick that was judged in the slot before."""
        loop = fleet.loop
        if loop.figures is self._shown or loop.figures is None:
            return
        figures = self._shown = loop.figures
        t_s = (loop.world.slot - 1) // SLOTS_PER_TICK * SLOTS_PER_TICK / loop.world.clock.slot_hz
        self._rest.see(loop.world.positions(), t_s)
        self._take(t_s, "separation", figures.separation, self._separation_m)
        if figures.obstacle_distance is not None:
            self._take(t_s, "clearance", figures.obstacle_distance, self._clearance_m)
        errors = [each for each in figures.slot_error.tolist() if not isnan(each)]
        self._rows["t_s"].append(t_s)
        self._rows["slot_error_m"].append(max(errors, default=nan))
        for name, tally in loop.judge.invariants().items():
            if tally.violations > self._violations.get(name, 0):
                self._violations[name] = tally.violations
                self._first_s.setdefault(name, t_s)

    def _take(self, t_s: float, name: str, distances: Any, bound_m: float) -> None:
        least = float(np.fmin.reduce(distances, initial=np.inf))
        self._rows[name].append((least - bound_m) / bound_m if bound_m else nan)
        if least < bound_m - ROUNDING_M:
            self._first_s.setdefault(name, t_s)

    def write(self, folder: Path) -> None:
        """Write what was seen, as margins.json; null where nothing could be measured."""
        rows = {
            name: [round(each, 4) if isfinite(each) else None for each in values]
            for name, values in self._rows.items()
        }
        content = {"first_s": self._first_s, "rest_since_s": self._rest.since_s, **rows}
        (folder / MARGINS_FILE).write_text(json.dumps(content, allow_nan=False), encoding="utf-8")
