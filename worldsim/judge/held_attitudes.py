"""Attitudes that agents hold at their slots, for ``expect.attitude_within_deg``.

An agent's attitude counts from the formation's convergence on, once the agent has stood in its slot
for 2 s and for the time that half a turn takes its vehicle. At the end every agent's counts. That
of an agent that measures its yaw wrong does not; afterwards it settles anew.
"""

from typing import Final

import numpy as np

from worldsim.judge.phase import Phase
from worldsim.judge.run_events import AgentFaultRunEvent, PoseChanged
from worldsim.judge.tick import Tick
from worldsim.scenario.tables import CONVERGED_M, CONVERGED_S, Scenario
from worldsim.truth.vehicle import Floats

HALF_TURN_DEG: Final = 180.0


class HeldAttitudes:
    """The largest difference of an agent's attitude from its queue's orientation."""

    def __init__(self, scenario: Scenario) -> None:
        rates_dps = np.array([vehicle.max_yaw_rate_dps for vehicle in scenario.vehicles])
        self._settling_s = CONVERGED_S + HALF_TURN_DEG / rates_dps
        self._since_s = np.full(len(rates_dps), np.inf)
        """(N,): since when each agent has been in its slot [s]; infinite while it is not."""
        self._wrong_yaws: set[tuple[int, int]] = set()
        """The faults of yaws in force: their numbers, each with an agent."""
        self._held_deg: float | None = None
        self._last_deg: float | None = None

    def open_phase(self) -> None:
        """Take the start of another formation or frame: every agent settles anew."""
        self._since_s[:] = np.inf

    def handle_event(self, event: AgentFaultRunEvent) -> None:
        """Take the beginning or the end of a fault of an agent."""
        if event.agent is None or not isinstance(event, PoseChanged):
            return
        fault = event.number, event.agent
        if event.ends:
            self._wrong_yaws.discard(fault)
        elif event.bias_yaw_deg:
            self._wrong_yaws.add(fault)

    def see(self, tick: Tick, phase: Phase, slot_error: Floats) -> None:
        """Take a tick. slot_error: (N,) distances of agents to their slots [m]."""
        in_place = tick.alive & (slot_error <= CONVERGED_M)
        self._since_s[in_place & np.isinf(self._since_s)] = tick.time_s
        self._since_s[~in_place] = np.inf
        errors_deg = phase.attitude_errors_deg(tick)
        for _, agent in self._wrong_yaws:
            self._since_s[agent] = np.inf
            errors_deg.pop(agent, None)
        self._last_deg = max(errors_deg.values(), default=None)
        if phase.converge_s is None:
            return
        settled = tick.time_s - self._since_s >= self._settling_s
        held_deg = max((deg for row, deg in errors_deg.items() if settled[row]), default=None)
        self._held_deg = _largest(self._held_deg, held_deg)

    @property
    def worst_deg(self) -> float | None:
        """The largest error, as if the run ended now [deg]; None where nothing counts."""
        return _largest(self._held_deg, self._last_deg)


def _largest(*values: float | None) -> float | None:
    return max((value for value in values if value is not None), default=None)
