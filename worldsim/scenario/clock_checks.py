"""Check of clock faults in force together: no agent's clock may show a time below 0 s.

Errors that put a clock ahead do not count: they may end before those that put it back.
"""

from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple

from worldsim.scenario.faults import ClockFault
from worldsim.scenario.problem import Problem
from worldsim.scenario.selectors import OneAgent, Selectors, parsed
from worldsim.scenario.timeline import Step

PPM = 1e-6
SLACK_S = 1e-6
"""Event times are rounded to the microsecond."""


class ClockErrorNow(NamedTuple):
    """A clock fault in force."""

    since_s: float
    """When it began [s; simulated time]."""
    offset_s: float
    drift_ppm: float
    agents: Sequence[int]


class ForeseenClocks:
    """How far back faults put each agent's clock, as far as it can be foreseen.

    rows: how many agents there may be; duration_s: of the run [s]; in_force: clock faults, by their
    numbers.
    """

    def __init__(
        self, rows: int, duration_s: float, in_force: Mapping[int, ClockErrorNow] | None = None
    ) -> None:
        self._rows, self._duration_s = rows, duration_s
        # An agent's clock is back by constant + rate * time.
        self._constant_s, self._rate = [0.0] * rows, [0.0] * rows
        self._held: dict[int, tuple[Sequence[int], float, float]] = {}
        for number, error in (in_force or {}).items():
            self._begin(number, error)

    def first_problem(self, steps: Iterable[Step]) -> tuple[Step, Problem] | None:
        """Return the first of some steps, in order, after which a clock may show less than 0 s."""
        for step in steps:
            problem = self.problem(step)
            if problem is not None:
                return step, problem
        return None

    def problem(self, step: Step) -> Problem | None:
        """Apply a step; return what is wrong where a clock may show less than 0 s after it."""
        fault = step.event.action
        if not isinstance(fault, ClockFault):
            return None
        if step.ends:
            self._end(step.number)
            return None
        agents = self._agents(fault.agents)
        error = ClockErrorNow(step.at_s, fault.offset_s, fault.drift_ppm, agents)
        self._begin(step.number, error)
        for agent in agents:
            below_s = self._below_0_at(agent, step.at_s)
            if below_s is not None:
                key = "offset_s" if fault.offset_s < 0.0 else "drift_ppm"
                detail = (
                    f"{getattr(fault, key):g}; with what is in force at {step.at_s:g} s, the clock"
                    f" of agent {agent} could show less than 0 s at {below_s:g} s"
                )
                return Problem(f"clock.{key}", detail)
        return None

    def _agents(self, selectors: Selectors) -> Sequence[int]:
        """Return the agents that selectors may select: any, where that is not known before."""
        found: set[int] = set()
        for selector in selectors:
            match parsed(selector):
                case OneAgent(agent):
                    found.add(agent)
                case _:
                    return range(self._rows)
        return sorted(found)

    def _begin(self, number: int, error: ClockErrorNow) -> None:
        rate = min(0.0, error.drift_ppm * PPM)
        constant_s = min(0.0, error.offset_s) - rate * error.since_s
        self._held[number] = (error.agents, constant_s, rate)
        self._add(error.agents, constant_s, rate)

    def _end(self, number: int) -> None:
        agents, constant_s, rate = self._held.pop(number, ((), 0.0, 0.0))
        self._add(agents, -constant_s, -rate)

    def _add(self, agents: Sequence[int], constant_s: float, rate: float) -> None:
        for agent in agents:
            self._constant_s[agent] += constant_s
            self._rate[agent] += rate

    def _below_0_at(self, agent: int, time_s: float) -> float | None:
        """Return from a time on when an agent's clock shows less than 0 s, if nothing ends [s]."""
        constant_s, pace = self._constant_s[agent], 1.0 + self._rate[agent]
        for at_s in (time_s, self._duration_s):
            if constant_s + pace * at_s < -SLACK_S:
                return at_s
        return None
