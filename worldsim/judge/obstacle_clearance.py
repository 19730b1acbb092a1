"""Distances from vehicles to obstacles: centre to surface, swept from tick to tick.

A vehicle that cannot give way is not its controller's fault where a moving obstacle comes too near:
a vehicle whose agent is not running (dead, paused or booting), and one that the obstacle outruns,
as long as the vehicle's own motion brings it no nearer. Such an encounter is reported, and lasts
until the two are clear of each other.
"""

from enum import StrEnum
from math import inf

import msgspec
import numpy as np
from numpy.typing import NDArray

from worldsim.judge.metrics import ROUNDING_M, keeps
from worldsim.judge.tick import Tick
from worldsim.scenario.obstacle_tables import Movable
from worldsim.scenario.tables import Scenario
from worldsim.truth.obstacles import Obstacles, Relative
from worldsim.truth.vehicle import Floats


class Hindrance(StrEnum):
    """Why a vehicle could not give way."""

    NOT_RUNNING = "not running"
    OUTRUN = "outrun"


class Encounter(msgspec.Struct):
    """A moving obstacle came too near to a vehicle that could not give way."""

    t_s: float
    """When it came too near [s; simulated time]."""
    agent: int
    obstacle: int
    """Its index in the scenario."""
    distance_m: float
    """The least distance, centre to surface [m]."""
    hindrance: Hindrance


class ObstacleClearance:
    """Measures the obstacle distances of a run; false where the scenario has no obstacles."""

    def __init__(self, scenario: Scenario) -> None:
        self._obstacles = Obstacles(scenario.obstacle)
        self._outruns = _outruns(scenario)
        self.bound_m = scenario.obstacle_bound_m
        self.least_m: float | None = None
        """The least distance so far [m]; None while nothing was measured."""
        self.answerable_m: float | None = None
        """The least so far of those that a controller answers for [m]; None while there is none."""
        self.encounters: list[Encounter] = []
        """Of vehicles that could not give way, in order."""
        self._last: tuple[Tick, Relative] | None = None
        """The last tick, and where its vehicles were relative to the obstacles."""
        self._lasting: dict[tuple[int, int], Encounter] = {}
        """By agent and obstacle: encounters that are not over."""

    def __bool__(self) -> bool:
        return len(self._obstacles) > 0

    @property
    def held(self) -> bool:
        """Whether no controller let its vehicle come nearer to an obstacle than the bound."""
        least_m = self.answerable_m
        return bool(self.encounters) if least_m is None else keeps(least_m, self.bound_m)

    def see(self, before: Tick, tick: Tick) -> tuple[Floats, bool]:
        """Return each vehicle's least distance (N,) [m] between ticks, and whether one is at fault.

        At fault is a vehicle that comes nearer than ``bound_m`` and could give way.
        """
        start = self._relative_at(before)
        self._last = tick, self._obstacles.relative(tick.position, tick.time_s)
        distance = self._obstacles.swept(start, self._last[1])
        self.least_m = _lesser(self.least_m, distance)
        near = distance < self.bound_m - ROUNDING_M
        if not near.any():
            self.answerable_m = _lesser(self.answerable_m, distance)
            self._lasting.clear()
            return np.min(distance, axis=1), False
        excused = self._excused(before, tick, near)
        answerable = np.where(excused, np.nan, distance)
        self.answerable_m = _lesser(self.answerable_m, answerable)
        self._note(tick, distance, excused)
        return np.min(distance, axis=1), bool(np.any(near & ~excused))

    def _relative_at(self, tick: Tick) -> Relative:
        if self._last is not None and self._last[0] is tick:
            return self._last[1]
        return self._obstacles.relative(tick.position, tick.time_s)

    def _excused(self, before: Tick, tick: Tick, near: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """Return which pairs (N, M) are too near without fault of the vehicle's controller."""
        excused = np.zeros(near.shape, dtype=np.bool_)
        for pair in self._lasting:
            excused[pair] = True
        from_m, to_m = (self._obstacles.centres(each.time_s) for each in (before, tick))
        moves = np.any(from_m != to_m, axis=1)
        stands = ~(before.alive & tick.alive)
        excused |= stands[:, None] & moves
        outrun = self._outruns & moves
        if outrun.any():
            here = self._obstacles.from_centres(before.position[:, None] - from_m).distance
            there = self._obstacles.from_centres(tick.position[:, None] - from_m).distance
            excused |= outrun & (there >= here - ROUNDING_M)
        return excused & near

    def _note(self, tick: Tick, distance: Floats, excused: NDArray[np.bool_]) -> None:
        """Begin, continue and end encounters; distance, excused: (N, M)."""
        pairs = {(int(agent), int(obstacle)) for agent, obstacle in np.argwhere(excused)}
        self._lasting = {pair: each for pair, each in self._lasting.items() if pair in pairs}
        for agent, obstacle in sorted(pairs):
            known = self._lasting.get((agent, obstacle))
            if known is None:
                why = Hindrance.OUTRUN if tick.alive[agent] else Hindrance.NOT_RUNNING
                known = Encounter(tick.time_s, agent, obstacle, inf, why)
                self._lasting[agent, obstacle] = known
                self.encounters.append(known)
            known.distance_m = min(known.distance_m, float(distance[agent, obstacle]))


def _outruns(scenario: Scenario) -> NDArray[np.bool_]:
    """Return which obstacle is faster than which vehicle (N, M)."""
    speeds = [
        (each.speed_mps or 0.0) if isinstance(each, Movable) else 0.0 for each in scenario.obstacle
    ]
    limits = [vehicle.max_speed_mps for vehicle in scenario.vehicles]
    outruns: NDArray[np.bool_] = np.array(speeds) > np.array(limits)[:, None]
    return outruns


def _lesser(before: float | None, distance: Floats) -> float | None:
    """Return the least of a value and of distances [m]; None where there is none."""
    least = float(np.fmin.reduce(distance, axis=None, initial=inf))
    if least == inf:
        return before
    return least if before is None else min(before, least)
