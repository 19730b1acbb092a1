"""The judge: sees every tick, and says in the end whether the expectations held.

It knows the formation, and what was true; of an agent's telemetry it takes only the place the
agent means to hold, and computes where that place is by itself.
"""

from collections import Counter
from dataclasses import dataclass
from math import degrees, inf, isfinite, remainder, tau
from typing import Any

import numpy as np

from agent.guidance.cone import cone_of
from agent.messages import Place
from agent.qstructure.formation import Formation, Slot
from agent.qstructure.frame import Frame
from worldsim.judge.metrics import Floats, conserved, swept_separation
from worldsim.judge.tick import Packets, Tick
from worldsim.scenario.tables import Scenario

CONVERGED_M = 0.12
CONVERGED_S = 2.0
TURN_LIMIT_SLACK_DEG = 1e-6


@dataclass(frozen=True, slots=True)
class Figures:
    """What the judge measured at one tick; NaN where there is nothing to measure.

    separation (N,) [m]: swept since the tick before; slot_error (N,) [m]: to the agent's own slot.
    """

    separation: Floats
    slot_error: Floats
    converged: bool


@dataclass(frozen=True, slots=True)
class Expectation:
    """One thing a run must show, and what it did show."""

    name: str
    wanted: Any
    got: Any
    held: bool


class Phase:
    """The time of one formation, and how the team came into it."""

    def __init__(self, formation: Formation, from_s: float) -> None:
        self.formation = formation
        self.from_s = from_s
        self.converge_s: float | None = None
        self.residual_m: float | None = None
        self._frame = Frame()
        self._since_s: float | None = None
        self._slots: dict[tuple[int, int, int], Slot | None] = {}
        self._owned: dict[int, Slot] = {}
        self._owned_by: tuple[bytes, bytes] | None = None

    def slot_error(self, tick: Tick) -> Floats:
        """Return each agent's distance to the slot it claims [m]; infinite without a valid one.

        Two that claim the same slot have none: neither counts as arrived.
        """
        error = np.full(len(tick.place), np.inf)
        slots = self._own_slots(tick)
        if slots:
            rows = list(slots)
            stands = [self._frame.to_world(slot.point) for slot in slots.values()]
            off = tick.position[rows].astype(np.float64) - np.array(stands)
            error[rows] = np.sqrt(np.sum(off * off, axis=1))
        error[np.isnan(tick.position[:, 0])] = np.nan
        return error

    def attitude_error_deg(self, tick: Tick) -> float | None:
        """Return the largest angle by which an agent misses its slot's orientation [deg].

        Angles that a queue leaves free do not count; None where all are free.
        """
        wanted = [
            (angle + (self._frame.yaw if axis == 0 else 0.0), float(tick.attitude[row, axis]))
            for row, slot in self._own_slots(tick).items()
            for axis, angle in enumerate(slot.attitude)
            if angle is not None and tick.alive[row]
        ]
        missed = [abs(remainder(angle - flown, tau)) for angle, flown in wanted]
        return degrees(max(missed)) if missed else None

    def _own_slots(self, tick: Tick) -> dict[int, Slot]:
        """Return the slot of each agent that claims a valid one alone, by row.

        What was found holds until a claim changes, or an agent goes.
        """
        claimed = tick.place.tobytes(), tick.alive.tobytes()
        if claimed != self._owned_by:
            self._owned_by, self._owned = claimed, self._find_slots(tick)
        return self._owned

    def _find_slots(self, tick: Tick) -> dict[int, Slot]:
        claims = [(queue, rank) for queue, rank in tick.place.tolist()]
        holders = Counter(claim for claim, alive in zip(claims, tick.alive, strict=True) if alive)
        team = int(np.sum(tick.alive))
        return {
            row: slot
            for row, claim in enumerate(claims)
            if holders[claim] <= 1 and (slot := self._slot(*claim, team)) is not None
        }

    def _slot(self, queue: int, rank: int, team: int) -> Slot | None:
        key = (queue, rank, team)
        if key not in self._slots:
            self._slots[key] = self.formation.slot(Place(queue, rank), team)
        return self._slots[key]

    def see(self, time_s: float, error: Floats) -> bool:
        """Take the living agents' slot errors [m] at a tick; return whether all are in place."""
        worst = float(np.fmax.reduce(error, initial=-np.inf))
        self.residual_m = worst if isfinite(worst) else None
        if not 0.0 <= worst <= CONVERGED_M:
            self._since_s = None
            return False
        if self._since_s is None:
            self._since_s = time_s
        if self.converge_s is None and time_s - self._since_s >= CONVERGED_S - 1e-9:
            self.converge_s = self._since_s - self.from_s
        return True


class Judge:
    """Sees every tick of a run under a scenario's expectations."""

    def __init__(self, scenario: Scenario) -> None:
        self._scenario = scenario
        self._formation = Formation(scenario.formation, scenario.control.spacing_m)
        self.phases = [Phase(self._formation, 0.0)]
        self.ticks = 0
        self.min_separation_m: float | None = None
        self.separation_violations = 0
        self.packet_ticks = 0
        self.packet_violations = 0
        cones = np.degrees([cone_of(vehicle) for vehicle in scenario.vehicles])
        self._turn_left_deg, self._turn_right_deg = cones.T + TURN_LIMIT_SLACK_DEG
        self._turns = 0
        self._turns_over = 0
        self._before: Tick | None = None

    def see(self, tick: Tick) -> Figures:
        """Judge one tick; ticks come in order."""
        before = self._before.position if self._before is not None else tick.position
        self._before = tick
        self.ticks += 1
        separation = swept_separation(before, tick.position)
        self._see_separation(separation)
        self._see_packets(tick.packets)
        self._turns += int(np.count_nonzero(~np.isnan(tick.turn_deg)))
        self._turns_over += int(np.count_nonzero(tick.turn_deg > self._turn_left_deg))
        self._turns_over += int(np.count_nonzero(tick.turn_deg < -self._turn_right_deg))
        phase = self.phases[-1]
        error = phase.slot_error(tick)
        in_place = phase.see(tick.time_s, np.where(tick.alive, error, np.nan))
        return Figures(separation, error, in_place)

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
        wanted_m = expect.min_separation_m
        if wanted_m is None:
            wanted_m = self._scenario.control.separation_m
        least = self.min_separation_m
        rows = [
            Expectation(
                "min_separation_m",
                wanted_m,
                least,
                least >= wanted_m if least is not None else self._scenario.fleet.agents == 1,
            )
        ]
        for phase in self.phases if expect.converge else ():
            within = expect.converge_within_s
            got = phase.converge_s
            held = got is not None and (within is None or got <= within)
            rows.append(Expectation(f"converge {phase.formation.name}", within, got, held))
        return rows

    def invariants(self) -> dict[str, dict[str, int]]:
        """Return each invariant checked at every tick: ticks evaluated, violations.

        I8 is evaluated wherever the medium's counters are known: in virtual time at every tick, in
        processes from netem's first report on.
        """
        return {
            "I1": {"ticks": self.ticks, "violations": self.separation_violations},
            "I8": {"ticks": self.packet_ticks, "violations": self.packet_violations},
        }

    def _see_packets(self, packets: Packets) -> None:
        if "addressed" in packets:
            self.packet_ticks += 1
            self.packet_violations += not conserved(packets)

    def _see_separation(self, separation: Floats) -> None:
        least = float(np.fmin.reduce(separation, initial=np.inf))
        if least == inf:
            return
        if self.min_separation_m is None or least < self.min_separation_m:
            self.min_separation_m = least
        if least < self._scenario.control.separation_m:
            self.separation_violations += 1
