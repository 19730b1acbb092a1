"""The judge: measures every tick of a run and decides whether the expectations are met.

It takes events and ticks in order, an event before the tick of its time. Given the events and ticks
of a recording, it reaches the same verdict.
"""

from math import inf, isnan
from typing import Final, NamedTuple, assert_never, final

import numpy as np

from agent.guidance.cone import cone_of
from agent.guidance.sight import vehicle_margin_m
from agent.messages import FramePath
from agent.qstructure.formation import FormationSpec, formation_of
from worldsim.judge.expectations import RunExpectations, RunMeasured, fault_window_s
from worldsim.judge.expected_places import ExpectedPlaces
from worldsim.judge.finding import Expectation, InvariantTally
from worldsim.judge.held_attitudes import HeldAttitudes
from worldsim.judge.held_formation import HeldFormation
from worldsim.judge.hovering_vehicles import HoveringVehicles
from worldsim.judge.invariants import Invariants
from worldsim.judge.metrics import Separation, conserved, keeps
from worldsim.judge.mission_order import MissionOrder
from worldsim.judge.network_strength import NetworkStrength
from worldsim.judge.obstacle_clearance import ObstacleClearance
from worldsim.judge.parting_faults import PartingFaults
from worldsim.judge.phase import Phase
from worldsim.judge.properties import Coverage, Measured, monitors_of
from worldsim.judge.queue_convergence import QueueConvergence
from worldsim.judge.radio_events import RadioRunEvent, Sabotaged
from worldsim.judge.recovery import Recoveries, Recovery
from worldsim.judge.run_events import (
    NOBODY_TO_RESTART,
    AgentFaultRunEvent,
    ClockChanged,
    ControllerLogged,
    DiskFilled,
    FormationGiven,
    FrameGiven,
    Intruded,
    Joined,
    Killed,
    LateStart,
    Left,
    LossEvent,
    MissionRunEvent,
    Paused,
    PoseChanged,
    QueueChanged,
    Reconnected,
    Restarted,
    Resumed,
    ReturnEvent,
    RoleChanged,
    RunEvent,
    SensorChanged,
    SlotChanged,
    SlowChanged,
    Starved,
    WorldStopped,
)
from worldsim.judge.sub_formations import SubFormations
from worldsim.judge.tick import Packets, Tick
from worldsim.scenario.tables import Scenario
from worldsim.scenario.target_frame import path_of
from worldsim.truth.vehicle import Floats, array_of

TURN_LIMIT_SLACK_DEG: Final = 1e-6


@final
class Figures:
    """The judge's measurements at one tick; row i = agent i, NaN where nothing can be measured.

    separation: (N,), least distance to any other vehicle since the last tick, centre to centre [m].
    slot_error: (N,), distance to the agent's own slot [m]; infinite without a valid one. converged:
    whether every agent is within 0.12 m of its slot. obstacle_distance: (N,), least distance since
    the last tick, centre to surface [m]; None without obstacles. queue_residual: (Q,), largest slot
    error in each queue [m].
    """

    def __init__(
        self,
        *,
        separation: Floats,
        slot_error: Floats,
        converged: bool,
        obstacle_distance: Floats | None = None,
        queue_residual: Floats | None = None,
    ) -> None:
        self.separation = separation
        self.slot_error = slot_error
        self.converged = converged
        self.obstacle_distance = obstacle_distance
        self.queue_residual = queue_residual


class Shortcomings(NamedTuple):
    """What speaks against a run; a run without any passes."""

    violated: list[str]
    """Invariants that were violated."""
    unseen: list[str]
    """Invariants that were never evaluated, and have to be."""
    missed: list[str]
    """Names of expectations that were not met."""
    unjudged: list[str]
    """Names of expectations that the run was too short for."""


class Judge:
    """Measures every tick of a run under a scenario's expectations."""

    def __init__(self, scenario: Scenario) -> None:
        self._scenario = scenario
        self.phases = [self._phase(scenario.formation, 0.0, path_of(scenario.frame))]
        self.queues = [QueueConvergence(self.phases[0])]
        self.sub_formations = [SubFormations(self.phases[0])]
        self._hovering = HoveringVehicles(
            scenario.control.spacing_m, vehicle_margin_m(scenario.sensor)
        )
        self._recoveries = Recoveries()
        self._without_room: list[Restarted | Joined] = []
        converges = scenario.expect.converge
        self._allocation = Invariants(scenario, self._hovering) if converges else None
        self.min_separation_m: float | None = None
        """The least separation so far [m]; None before two vehicles were in the world."""
        self.clearance = ObstacleClearance(scenario)
        bounded = scenario.expect.attitude_within_deg is not None
        self._attitudes = HeldAttitudes(scenario) if bounded else None
        self._parting = PartingFaults(scenario)
        self._held = HeldFormation(fault_window_s(scenario), self._parting)
        strength = scenario.expect.min_lambda2 is not None
        self._strength = NetworkStrength(scenario) if strength else None
        self._missions = MissionOrder()
        self._properties = monitors_of(scenario)
        self._safety = InvariantTally()
        self._conservation = InvariantTally()
        cones = np.degrees([cone_of(vehicle) for vehicle in scenario.vehicles])
        self._turn_left_deg: list[float]
        self._turn_right_deg: list[float]
        self._turn_left_deg, self._turn_right_deg = (cones.T + TURN_LIMIT_SLACK_DEG).tolist()
        self._turns = 0
        self._turns_over = 0
        self._last: Tick | None = None
        self._separation = Separation()

    @property
    def ticks(self) -> int:
        """Number of ticks judged so far."""
        return self._safety.ticks

    def handle_event(self, event: RunEvent) -> None:
        """Take an event; events come in order."""
        if self._allocation is not None:
            self._allocation.handle_event(event)
        if isinstance(event, RadioRunEvent):
            self._handle_radio(event)
            return
        match event:
            case FormationGiven() | FrameGiven():
                self._open_phase(event)
            case Restarted() | Joined() | Killed() | Left() | Paused() | Resumed():
                self._change_team(event)
            case ClockChanged() | PoseChanged() | SlowChanged() | Starved():
                self._handle_agent_fault(event)
            case SensorChanged():
                self._held.open_window(event.t_s)
            case WorldStopped() | Reconnected():
                self._handle_stop(event)
            case (
                SlotChanged()
                | QueueChanged()
                | RoleChanged()
                | Intruded()
                | LateStart()
                | DiskFilled()
                | ControllerLogged()
            ):
                pass
            case _:
                assert_never(event)

    def _handle_radio(self, event: RadioRunEvent) -> None:
        if isinstance(event, Sabotaged):
            return  # whatever somebody sends, it excuses nobody
        if self._strength is not None:
            self._strength.handle_event(event)
        disturbs = self._parting.handle_event(event)
        self._note_parting(event.t_s)
        if not disturbs:
            return  # what has cut no link excuses nobody
        self._held.open_window(event.t_s)
        if not self._parting.in_force:
            self._recoveries.handle_radio(event)

    def _handle_agent_fault(self, event: AgentFaultRunEvent) -> None:
        if event.agent is None:
            return  # what struck nobody excuses nobody
        if self._attitudes is not None:
            self._attitudes.handle_event(event)
        self._parting.handle_agent_fault(event)
        self._note_parting(event.t_s)
        self._held.open_window(event.t_s)
        if not self._parting.in_force:
            self._recoveries.handle_agent_fault(event)

    def _handle_stop(self, event: WorldStopped | Reconnected) -> None:
        self._parting.handle_stop(event)
        self._note_parting(event.t_s)
        self._held.open_window(event.t_s)
        if isinstance(event, Reconnected) and not self._parting.in_force:
            self._recoveries.handle_radio(event)

    def _note_parting(self, t_s: float) -> None:
        """Let no time to form count while a fault forbids it."""
        forbidden = bool(self._parting)
        self.phases[-1].note(t_s, forbidden=forbidden)
        self._recoveries.note(t_s, forbidden=forbidden)

    def _change_team(self, event: LossEvent | ReturnEvent) -> None:
        if isinstance(event, Restarted | Joined):
            if event.refused == NOBODY_TO_RESTART:
                return
            if event.refused is not None:
                self._without_room.append(event)
            if event.agent is not None:
                self._missions.forget(event.agent)
        elif event.nobody is not None:
            return
        self._held.open_window(event.t_s)
        self._recoveries.handle_event(event)

    def see(self, tick: Tick) -> Figures:
        """Judge a tick; ticks come in order."""
        last = self._last if self._last is not None else tick
        self._last = tick
        if self._parting.see(tick):
            self._note_parting(tick.time_s)
            self._held.open_window(tick.time_s)
        self._hovering.see(tick)
        separation = self._separation.swept(tick.position)
        distance, too_near = self.clearance.see(last, tick) if self.clearance else (None, False)
        self._safety.count(self._is_too_near(separation) or too_near)
        self._check_packets(tick.packets)
        self._missions.see(tick)
        self._count_turns(tick)
        phase = self.phases[-1]
        team = [row for row, runs in enumerate(tick.alive.tolist()) if runs]
        error = phase.slot_error(tick, self._hovering.places_left_out(tick, phase, team))
        in_place = phase.see(tick.time_s, [error[row] for row in team])
        slot_error = array_of(error)
        if self._attitudes is not None:
            self._attitudes.see(tick, phase, slot_error)
        self.sub_formations[-1].see(tick)
        self._recoveries.see(tick, in_place)
        counts = self._held.see(tick, phase, in_place)
        if self._strength is not None and counts:
            self._strength.see(tick)
        if self._allocation is not None:
            self._allocation.see(tick, phase)
        self._see_properties(
            Measured(
                tick=tick,
                before=last,
                separation=separation,
                slot_error=slot_error,
                obstacle_distance=distance,
                parted=bool(self._parting),
                disturbed=self._held.disturbed(tick.time_s),
            )
        )
        return Figures(
            separation=separation,
            slot_error=slot_error,
            converged=in_place,
            obstacle_distance=distance,
            queue_residual=np.array(self.queues[-1].see(tick, error)),
        )

    def _see_properties(self, measured: Measured) -> None:
        for each in self._properties:
            each.see(measured)

    @property
    def coverage(self) -> list[Coverage]:
        """What of a campaign's runs the run covers: properties that hold sometimes."""
        return [each.coverage for each in self._properties if each.coverage is not None]

    @property
    def recoveries(self) -> list[Recovery]:
        """Every change of the team, and its time to re-form."""
        return self._recoveries.all

    @property
    def in_formation_fraction(self) -> float | None:
        """Share of the time in formation, from convergence on and outside the faults' windows."""
        return self._held.in_place_fraction

    @property
    def max_slot_error_m(self) -> float | None:
        """Largest slot error in that time [m]; None where none of it counts."""
        return self._held.worst_m

    @property
    def min_lambda2(self) -> float | None:
        """Least algebraic connectivity in that time; None where it is not expected."""
        return None if self._strength is None else self._strength.least

    @property
    def min_obstacle_distance_m(self) -> float | None:
        """The least distance from a vehicle's centre to a surface [m]; None without obstacles."""
        return self.clearance.least_m

    @property
    def attitude_error_deg(self) -> float | None:
        """Largest attitude error at the last tick [deg]; None where every angle is free."""
        return None if self._last is None else self.phases[-1].attitude_error_deg(self._last)

    @property
    def turns_over_limit_fraction(self) -> float | None:
        """Share of moving steps whose wanted turn exceeds the vehicle's limit; None without any."""
        return self._turns_over / self._turns if self._turns else None

    def expectations(self) -> list[Expectation]:
        """Return every expectation of the run with its measured value."""
        attitudes = self._attitudes
        measured = RunMeasured(
            until_s=0.0 if self._last is None else self._last.time_s,
            min_separation_m=self.min_separation_m,
            clearance=self.clearance,
            phases=self.phases,
            recoveries=self.recoveries,
            parted=bool(self._parting),
            in_formation_fraction=self.in_formation_fraction,
            max_slot_error_m=self.max_slot_error_m,
            min_lambda2=self.min_lambda2,
            worst_attitude_deg=None if attitudes is None else attitudes.worst_deg,
            without_room=self._without_room,
        )
        own = [each.expectation() for each in self._properties]
        rows = RunExpectations(self._scenario, measured).rows()
        return [*rows, *(each for each in own if each is not None)]

    def invariants(self) -> dict[str, InvariantTally]:
        """Return the tally of each invariant.

        I1: no two vehicles are too near, and none is too near to an obstacle. I5: no agent goes
        back to an older mission while its process lives. I8: conservation of
        packets, evaluated where the medium's counters are known: in virtual time at every tick, in
        processes from netem's first report on. An allocation invariant whose premise never held is
        absent; all are absent where the run need not converge.
        """
        tallies = self._allocation.tallies if self._allocation is not None else {}
        allocation = {name: tally for name, tally in tallies.items() if tally.ticks}
        others = {"I1": self._safety, "I5": self._missions.tally, "I8": self._conservation}
        return dict(sorted((allocation | others).items()))

    def shortcomings(self) -> Shortcomings:
        """Return what speaks against the run."""
        tallies = self.invariants()
        return Shortcomings(
            violated=[name for name, tally in tallies.items() if tally.violations],
            unseen=[name for name, tally in tallies.items() if not tally.ticks],
            missed=[row.name for row in self.expectations() if row.held is False],
            unjudged=[row.name for row in self.expectations() if row.held is None],
        )

    def _open_phase(self, event: MissionRunEvent) -> None:
        self.phases.append(self._phase(event.tables, event.t_s, event.path, event.mission))
        self._note_parting(event.t_s)
        self.queues.append(QueueConvergence(self.phases[-1]))
        self.sub_formations.append(SubFormations(self.phases[-1]))
        if self._attitudes is not None:
            self._attitudes.open_phase()

    def _phase(
        self, spec: FormationSpec, from_s: float, path: FramePath, mission: int = 0
    ) -> Phase:
        spacing_m = self._scenario.control.spacing_m
        expected = ExpectedPlaces(spec, spacing_m)
        return Phase(formation_of(spec, spacing_m), from_s, path, mission, expected)

    def _check_packets(self, packets: Packets) -> None:
        if "addressed" in packets:
            self._conservation.count(not conserved(packets))

    def _count_turns(self, tick: Tick) -> None:
        left_deg, right_deg = self._turn_left_deg, self._turn_right_deg
        for row, turn_deg in enumerate(tick.turn_deg.tolist()):
            if not isnan(turn_deg):
                self._turns += 1
                self._turns_over += turn_deg > left_deg[row] or turn_deg < -right_deg[row]

    def _is_too_near(self, separation: Floats) -> bool:
        """Take the separations of a tick (N,) [m]; return whether any is below the limit."""
        least = inf
        for distance_m in separation.tolist():
            least = min(least, distance_m)
        if least == inf:
            return False
        if self.min_separation_m is None or least < self.min_separation_m:
            self.min_separation_m = least
        return not keeps(least, self._scenario.control.separation_m)
