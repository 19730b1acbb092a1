"""Expectations: what a scenario requires of a run, beside what the judge measured of it."""

from collections.abc import Sequence
from math import inf
from typing import Final, NamedTuple

from worldsim.judge.finding import Expectation
from worldsim.judge.metrics import keeps
from worldsim.judge.obstacle_clearance import ObstacleClearance
from worldsim.judge.phase import Phase
from worldsim.judge.recovery import Recovery
from worldsim.judge.run_events import Joined, Restarted
from worldsim.scenario.tables import Scenario

DISTURBED_S: Final = 10.0
"""A fault disturbs the formation for so long [s], unless ``expect.reform_within_s`` is given."""


def fault_window_s(scenario: Scenario) -> float:
    """Return for how long a fault disturbs the formation [s]."""
    return scenario.expect.reform_within_s or DISTURBED_S


class RunMeasured(NamedTuple):
    """What the judge measured of a run so far; None where there was nothing to measure."""

    until_s: float
    """The time of the last tick [s]."""
    min_separation_m: float | None
    clearance: ObstacleClearance
    phases: Sequence[Phase]
    recoveries: Sequence[Recovery]
    parted: bool
    """Whether a fault in force parts the team."""
    in_formation_fraction: float | None
    max_slot_error_m: float | None
    min_lambda2: float | None
    worst_attitude_deg: float | None
    without_room: Sequence[Restarted | Joined]
    """Starts of agents that found no room."""


class RunExpectations:
    """The expectations of a scenario on a run."""

    def __init__(self, scenario: Scenario, measured: RunMeasured) -> None:
        self._scenario, self._measured = scenario, measured

    def rows(self) -> list[Expectation]:
        """Return every expectation with its measured value."""
        expect = self._scenario.expect
        rows = [self._separated()]
        if self._measured.clearance:
            rows.append(self._cleared())
        if expect.converge:
            rows += [self._converged(phase) for phase in self._measured.phases]
        if expect.reform_within_s is not None:
            rows.append(self._reformed(expect.reform_within_s))
        rows += self._held_rows()
        if expect.attitude_within_deg is not None:
            rows.append(self._oriented(expect.attitude_within_deg))
        return [*rows, *map(_started, self._measured.without_room)]

    def _separated(self) -> Expectation:
        wanted_m = self._scenario.separation_bound_m
        least_m = self._measured.min_separation_m
        held = keeps(least_m, wanted_m) if least_m is not None else self._scenario.fleet.agents == 1
        name = "min_separation_m"
        return Expectation(name=name, wanted=wanted_m, got=least_m, held=held, at_least=True)

    def _cleared(self) -> Expectation:
        clearance = self._measured.clearance
        return Expectation(
            name="min_obstacle_distance_m",
            wanted=clearance.bound_m,
            got=clearance.answerable_m,
            held=clearance.held,
            at_least=True,
        )

    def _converged(self, phase: Phase) -> Expectation:
        within_s = self._scenario.expect.converge_within_s
        asked_s = phase.asked_s(self._end_s(phase))
        # Where a fault forbade it to the last, the true time tells more than what was asked for.
        untimed = phase.timed_from_s is None
        got_s = phase.converge_s if untimed or phase.converge_s is None else asked_s
        held: bool | None = got_s is not None and (within_s is None or got_s <= within_s)
        if held is False and (got_s is None or untimed):
            held = None if asked_s < self._time_to_converge_s(phase) else False
        name = f"converge {phase.formation.name}"
        return Expectation(name=name, wanted=within_s, got=got_s, held=held)

    def _time_to_converge_s(self, phase: Phase) -> float:
        """Return the limit of a formation's convergence [s].

        Without one it is the planned duration; after a fault that forbade it, at least the window
        of a fault.
        """
        within_s, from_s = self._scenario.expect.converge_within_s, phase.timed_from_s
        if within_s is not None:
            return within_s
        if from_s is None:
            return inf
        left_s = self._planned_end_s - from_s
        return left_s if from_s == phase.from_s else max(left_s, fault_window_s(self._scenario))

    def _end_s(self, phase: Phase) -> float:
        """Return until when a formation was asked for, so far [s]."""
        later = self._measured.phases[self._measured.phases.index(phase) + 1 :]
        return later[0].from_s if later else self._measured.until_s

    @property
    def _planned_end_s(self) -> float:
        """When the run is to end, less a tick [s]: where nothing else is asked for, the limit."""
        return self._scenario.duration_s - 1.0 / self._scenario.fleet.tick_hz

    def _reformed(self, within_s: float) -> Expectation:
        known_s = [
            each.reformed_s for each in self._measured.recoveries if each.reformed_s is not None
        ]
        open_s = [each.asked_s for each in self._measured.recoveries if each.reformed_s is None]
        worst_s = max(known_s) if known_s and not open_s else None
        recoveries = self._measured.recoveries
        too_late = any(each.is_late(within_s) for each in recoveries)
        # While a fault parts the team, it has still to re-form after its end.
        untimed = any(time_s > within_s for time_s in known_s)
        is_open = bool(open_s or untimed or self._measured.parted)
        held = False if too_late else None if is_open else True
        return Expectation(name="reform_within_s", wanted=within_s, got=worst_s, held=held)

    def _held_rows(self) -> list[Expectation]:
        """Return what is expected of the formation once it has converged."""
        expect = self._scenario.expect
        fraction, worst_m = self._measured.in_formation_fraction, self._measured.max_slot_error_m
        rows = []
        if expect.in_formation_fraction is not None:
            wanted = expect.in_formation_fraction
            held = None if fraction is None else fraction >= wanted
            name = "in_formation_fraction"
            rows.append(
                Expectation(name=name, wanted=wanted, got=fraction, held=held, at_least=True)
            )
        if expect.max_slot_error_m is not None:
            wanted = expect.max_slot_error_m
            held = None if worst_m is None else worst_m <= wanted
            name = "max_slot_error_m"
            rows.append(Expectation(name=name, wanted=wanted, got=worst_m, held=held))
        if expect.min_lambda2 is not None:
            rows.append(self._connected(expect.min_lambda2))
        return rows

    def _connected(self, wanted: float) -> Expectation:
        least = self._measured.min_lambda2
        held = None if least is None else least >= wanted
        return Expectation(name="min_lambda2", wanted=wanted, got=least, held=held, at_least=True)

    def _oriented(self, within_deg: float) -> Expectation:
        worst_deg = self._measured.worst_attitude_deg
        held: bool | None
        if worst_deg is None:
            oriented = any(phase.formation.oriented for phase in self._measured.phases)
            # While yaws are measured wrong, none counts.
            held = (None if self._measured.parted else False) if oriented else True
        else:
            held = worst_deg <= within_deg
        name = "attitude_within_deg"
        return Expectation(name=name, wanted=within_deg, got=worst_deg, held=held)


def _started(event: Restarted | Joined) -> Expectation:
    """Return the expectation that a start without room does not meet: that agents start."""
    name = f"{event.kind} at {event.t_s:g} s"
    return Expectation(name=name, wanted=None, got=None, held=False)
