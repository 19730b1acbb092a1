"""One flight in virtual time, measured exactly, and what it showed."""

import subprocess
import sys
from dataclasses import dataclass, field
from math import inf
from pathlib import Path
from typing import Any

import numpy as np

from worldsim.campaign.pool import finished
from worldsim.engine.preflight import VIRTUAL_COMMAND_TICKS, admit
from worldsim.engine.virtual import Flight, VirtualFleet
from worldsim.judge.metrics import Separation, swept_obstacle_distance
from worldsim.judge.radio_events import RadioRunEvent
from worldsim.results.summary import summarise
from worldsim.scenario.file import dump, parse
from worldsim.scenario.tables import Scenario
from worldsim.truth.obstacles import Obstacles

ROOT = Path(__file__).resolve().parents[2]


@dataclass
class Least:
    """A least distance of a flight [m], when it was [s; simulated time], and whose it was."""

    distance_m: float = inf
    time_s: float = 0.0
    agent: int = -1
    runs: bool = True
    """Whether the agent ran then; one that is dead or paused cannot give way."""

    def see(self, distances: Any, time_s: float, running: Any) -> None:
        """Take distances (N,) [m]; NaN where there is none; running: (N,)."""
        least = float(np.fmin.reduce(distances, initial=inf))
        if least < self.distance_m:
            self.distance_m, self.time_s = least, time_s
            self.agent = int(np.nanargmin(distances))
            self.runs = bool(running[self.agent])

    @property
    def when(self) -> tuple[float, int, str]:
        return self.time_s, self.agent, "running" if self.runs else "not running"


@dataclass
class Measured:
    """The exact least distances of a flight: slot by slot, in which all motion is straight."""

    obstacles: Obstacles
    separation: Least = field(default_factory=Least)
    clearance: Least = field(default_factory=Least)
    _swept: Separation = field(default_factory=Separation)
    _before: Any = None
    _before_s: float = 0.0

    def see(self, positions: Any, time_s: float, running: Any) -> None:
        """Take the true positions (N, 3) [m; world frame] at the start of a slot."""
        self.separation.see(self._swept.swept(positions), time_s, running)
        if len(self.obstacles):
            before = positions if self._before is None else self._before
            times_s = (self._before_s, time_s)
            distances = swept_obstacle_distance(before, positions, self.obstacles, times_s)
            self.clearance.see(distances, time_s, running)
        self._before, self._before_s = positions.copy(), time_s


@dataclass
class Flown:
    """What a flight showed, as plain values."""

    trace: str
    outcome: str
    broken: dict[str, int]
    """Ticks at which each invariant was violated."""
    separation_m: float | None
    """The least distance between two centres, exactly; None: there were never two."""
    separation_bound_m: float
    separation_at: tuple[float, int, str]
    """When it was [s; simulated time], one of the two agents, and whether that one ran."""
    clearance_m: float | None
    clearance_bound_m: float
    clearance_at: tuple[float, int, str]
    rejected: int
    """Messages that agents rejected."""
    features: list[str]

    @property
    def least_margin_m(self) -> float:
        """The least distance over its bound [m]; infinite where nothing was near anything."""
        near, close = self.separation_m, self.clearance_m
        apart = inf if near is None else near - self.separation_bound_m
        return min(apart, inf if close is None else close - self.clearance_bound_m)


def flown(file: Path) -> Flown:
    """Fly a scenario's file. Raises whatever the flight raises, and ValueError if files differ."""
    scenario = parse(file.read_text(encoding="utf-8"), file)
    if parse(dump(scenario)) != scenario:
        raise ValueError("the resolved scenario is not the one that was resolved")
    admit(scenario, file, VIRTUAL_COMMAND_TICKS)
    return measured(scenario)


def measured(scenario: Scenario) -> Flown:
    """Fly a scenario slot by slot, and measure each slot."""
    fleet, seen = VirtualFleet(scenario), Measured(Obstacles(scenario.obstacle))
    world = fleet.loop.world
    while world.slot < scenario.slots and fleet.ended_by is None:
        fleet.slot()
        seen.see(world.vehicles.position, world.time_s, fleet.loop.members.running)
    fleet.loop.finish()
    flight = Flight(fleet.loop, fleet.medium_counters, fleet.rejected, wall_s=1.0, cpu_s=1.0)
    return _flown(scenario, flight, seen)


def _flown(scenario: Scenario, flight: Flight, seen: Measured) -> Flown:
    summary = summarise(scenario, finished(flight, scenario))
    tallies = flight.loop.judge.invariants()
    near, close = seen.separation, seen.clearance
    return Flown(
        trace=flight.loop.trace.sha256,
        outcome=summary["outcome"],
        broken={name: each.violations for name, each in tallies.items() if each.violations},
        separation_m=near.distance_m if near.distance_m < inf else None,
        separation_bound_m=scenario.control.separation_m,
        separation_at=near.when,
        clearance_m=close.distance_m if close.distance_m < inf else None,
        clearance_bound_m=scenario.obstacle_bound_m,
        clearance_at=close.when,
        rejected=flight.rejected,
        features=features(scenario, flight),
    )


def features(scenario: Scenario, flight: Flight) -> list[str]:
    """Return what a scenario has that may explain what its flight showed."""
    found = {each.kind for each in scenario.vehicles}
    found |= {"+".join(each.sensors) or "no sensor" for each in scenario.vehicles}
    if scenario.sensor.proximity.noise_m:
        found.add("noise")
    if scenario.obstacle:
        moves = any(getattr(each, "waypoints_m", None) for each in scenario.obstacle)
        found.add("moving obstacle" if moves else "obstacle at rest")
    for event in flight.loop.events:
        name = type(event).__name__
        if name not in ("SlotChanged", "QueueChanged", "RoleChanged"):
            found.add("radio fault" if isinstance(event, RadioRunEvent) else name)
    if scenario.control.controller != "q_structure":
        found.add(scenario.control.controller)
    return sorted(found)


def trace_of_fresh_interpreter(file: Path) -> str:
    """Return the trace that a new interpreter finds, whose hashes of texts differ from ours."""
    done = subprocess.run(
        [sys.executable, "-m", "tests.random_flights.fly", str(file)],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
    )
    if done.returncode:
        raise RuntimeError(done.stderr.strip().splitlines()[-1] if done.stderr else "no answer")
    return done.stdout.strip()


if __name__ == "__main__":
    print(flown(Path(sys.argv[1])).trace)
