"""The judge: sees every tick, and says in the end whether the expectations held.

It sees ticks and is told events, in order; an event counts before the tick of its time. The same
judge, fed from a recording, comes to the same verdict.
"""

from dataclasses import asdict, dataclass
from math import inf
from typing import Any

import numpy as np

from agent.guidance.cone import cone_of
from agent.qstructure.formation import Formation
from worldsim.judge.hovering_vehicles import HoveringVehicles
from worldsim.judge.invariants import Invariants
from worldsim.judge.metrics import Separation, conserved
from worldsim.judge.obstacle_clearance import ObstacleClearance
from worldsim.judge.phase import Phase
from worldsim.judge.queue_convergence import QueueConvergence
from worldsim.judge.recovery import Recoveries, Recovery
from worldsim.judge.run_events import (
    FormationGiven,
    FrameGiven,
    Joined,
    Killed,
    Left,
    MissionRunEvent,
    Paused,
    Restarted,
    Resumed,
    RunEvent,
)
from worldsim.judge.tick import Packets, Tick
from worldsim.scenario.tables import Scenario
from worldsim.scenario.target_frame import path_of
from worldsim.truth.vehicle import Floats

TURN_LIMIT_SLACK_DEG = 1e-6


@dataclass(frozen=True, slots=True)
class Figures:
    """What the judge measured at one tick; NaN where there is nothing to measure.

    separation (N,) [m]: swept since the tick before; slot_error (N,) [m]: to the agent's own slot;
    obstacle_distance (N,) [m]: centre to surface, swept likewise; None where there is no obstacle.
    queue_residual (Q,) [m]: of each queue by itself.
    """

    separation: Floats
    slot_error: Floats
    converged: bool
    obstacle_distance: Floats | None = None
    queue_residual: Floats | None = None


@dataclass(frozen=True, slots=True)
class Expectation:
    """One thing a run must show, and what it did show."""

    name: str
    wanted: Any
    got: Any
    held: bool


class Judge:
    """Sees every tick of a run under a scenario's expectations."""

    def __init__(self, scenario: Scenario) -> None:
        self._scenario = scenario
        formation = Formation(scenario.formation, scenario.control.spacing_m)
        self.phases = [Phase(formation, 0.0, path_of(scenario.frame))]
        self.queues = [QueueConvergence(self.phases[0])]
        self._bodies = HoveringVehicles(scenario.control.spacing_m)
        self._recoveries = Recoveries(self._bodies)
        self._allocation = Invariants(scenario, self._bodies) if scenario.expect.converge else None
        self.ticks = 0
        self.min_separation_m: float | None = None
        self.clearance = ObstacleClearance(scenario)
        self.safety_violations = 0
        self.packet_ticks = 0
        self.packet_violations = 0
        cones = np.degrees([cone_of(vehicle) for vehicle in scenario.vehicles])
        self._turn_left_deg, self._turn_right_deg = cones.T + TURN_LIMIT_SLACK_DEG
        self._turns = 0
        self._turns_over = 0
        self._before: Tick | None = None
        self._separation = Separation()

    def note(self, event: RunEvent) -> None:
        """Take an event of the run, in order; most kinds change nothing for the judge."""
        if self._allocation is not None:
            self._allocation.note(event)
        match event:
            case FormationGiven() | FrameGiven():
                self._open_phase(event)
            case Restarted() | Joined():
                self._recoveries.note(event)
            case Killed() | Left() | Paused() | Resumed() if event.nobody is None:
                self._recoveries.note(event)

    def see(self, tick: Tick) -> Figures:
        """Judge one tick; ticks come in order."""
        before = self._before if self._before is not None else tick
        self._before = tick
        self.ticks += 1
        self._bodies.see(tick)
        separation = self._separation.swept(tick.position)
        distance, too_near = self.clearance.see(before, tick) if self.clearance else (None, False)
        self.safety_violations += self._see_separation(separation) or too_near
        self._see_packets(tick.packets)
        self._turns += int(np.count_nonzero(~np.isnan(tick.turn_deg)))
        self._turns_over += int(np.count_nonzero(tick.turn_deg > self._turn_left_deg))
        self._turns_over += int(np.count_nonzero(tick.turn_deg < -self._turn_right_deg))
        phase = self.phases[-1]
        error = phase.slot_error(tick)
        in_place = phase.see(tick.time_s, np.where(tick.alive, error, np.nan))
        self._recoveries.see(tick, phase, in_place)
        if self._allocation is not None:
            self._allocation.see(tick, phase, in_place)
        return Figures(
            separation=separation,
            slot_error=error,
            converged=in_place,
            obstacle_distance=distance,
            queue_residual=self.queues[-1].see(tick, error),
        )

    @property
    def recoveries(self) -> list[Recovery]:
        """Every change of the team, and how long it took to re-form."""
        return self._recoveries.all

    @property
    def min_obstacle_distance_m(self) -> float | None:
        """The least distance from a vehicle's centre to a surface [m]; None without obstacles."""
        return self.clearance.least_m

    @property
    def attitude_error_deg(self) -> float | None:
        """Largest angle missed at the last tick [deg]; None where every angle is free."""
        return None if self._before is None else self.phases[-1].attitude_error_deg(self._before)

    @property
    def turns_over_limit_fraction(self) -> float | None:
        """Share of moving steps whose wanted turn exceeds the vehicle's; None without any."""
        return self._turns_over / self._turns if self._turns else None

    def expectations(self) -> list[Expectation]:
        """Return what was expected of the run and what it showed."""
        expect = self._scenario.expect
        wanted_m = self._scenario.separation_bound_m
        least = self.min_separation_m
        rows = [
            Expectation(
                "min_separation_m",
                wanted_m,
                least,
                least >= wanted_m if least is not None else self._scenario.fleet.agents == 1,
            )
        ]
        if self.clearance:
            rows.append(self._cleared())
        for phase in self.phases if expect.converge else ():
            within = expect.converge_within_s
            got = phase.converge_s
            held = got is not None and (within is None or got <= within)
            rows.append(Expectation(f"converge {phase.formation.name}", within, got, held))
        if expect.reform_within_s is not None:
            rows.append(self._reformed(expect.reform_within_s))
        return rows

    def invariants(self) -> dict[str, dict[str, int]]:
        """Return each invariant checked at every tick: ticks evaluated, violations.

        I1: no two vehicles too near, and none to an obstacle. I8 is evaluated wherever the medium's
        counters are known: in virtual time at every tick, in processes from netem's first report
        on. One of allocation whose premise never held is absent, as are all of them where no
        formation is to be formed.
        """
        tallies = self._allocation.tallies if self._allocation is not None else {}
        allocation = {name: asdict(tally) for name, tally in tallies.items() if tally.ticks}
        return {
            "I1": {"ticks": self.ticks, "violations": self.safety_violations},
            **allocation,
            "I8": {"ticks": self.packet_ticks, "violations": self.packet_violations},
        }

    def _open_phase(self, event: MissionRunEvent) -> None:
        formation = Formation(event.tables, self._scenario.control.spacing_m)
        self.phases.append(Phase(formation, event.t_s, event.path, event.mission))
        self.queues.append(QueueConvergence(self.phases[-1]))

    def _reformed(self, within_s: float) -> Expectation:
        took = [recovery.reformed_s for recovery in self.recoveries]
        known = [each for each in took if each is not None]
        worst_s = max(known) if known and len(known) == len(took) else None
        held = len(known) == len(took) and all(each <= within_s for each in known)
        return Expectation("reform_within_s", within_s, worst_s, held)

    def _cleared(self) -> Expectation:
        wanted_m, least_m = self.clearance.bound_m, self.min_obstacle_distance_m
        held = least_m is not None and least_m >= wanted_m
        return Expectation("min_obstacle_distance_m", wanted_m, least_m, held)

    def _see_packets(self, packets: Packets) -> None:
        if "addressed" in packets:
            self.packet_ticks += 1
            self.packet_violations += not conserved(packets)

    def _see_separation(self, separation: Floats) -> bool:
        """Take the distances of a tick [m]; return whether two were too near."""
        least = float(np.fmin.reduce(separation, initial=np.inf))
        if least == inf:
            return False
        if self.min_separation_m is None or least < self.min_separation_m:
            self.min_separation_m = least
        return least < self._scenario.control.separation_m
