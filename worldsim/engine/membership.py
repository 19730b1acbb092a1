"""The team's membership: the state of each agent's process, and which agents an event means.

A row belongs to one agent for the whole run. The rows of agents that have not joined are the last.
"""

from collections.abc import Set as AbstractSet
from math import inf
from typing import assert_never

import numpy as np

from worldsim.engine.operations import (
    AdmitAgents,
    EndProcesses,
    PauseProcesses,
    ProcessOperation,
    ResumeProcesses,
    SetSensorMode,
    StartProcesses,
)
from worldsim.engine.placement import Placement
from worldsim.engine.process_life import (
    ALIVE,
    ENDED,
    KNOWN,
    STARTED,
    Cause,
    State,
    next_state,
)
from worldsim.engine.selection import Candidates, Claims, selected
from worldsim.scenario.faults import (
    Join,
    Kill,
    Leave,
    Pause,
    ProcessFault,
    Restart,
    Resume,
    Selectors,
    SensorFault,
)
from worldsim.scenario.tables import Scenario
from worldsim.truth.start_positions import StartError
from worldsim.truth.vehicle import Floats

SLACK_S = 1e-9


class Membership:
    """The state of every agent's process, by row."""

    def __init__(self, scenario: Scenario) -> None:
        agents, rows = scenario.fleet.agents, scenario.rows
        self._scenario = scenario
        self._placement = Placement(scenario)
        self._states = [State.RUNNING] * agents + [State.ABSENT] * (rows - agents)
        self._boots_s: dict[int, float] = {}
        self._struck: dict[int, tuple[int, ...]] = {}
        self.alive = np.arange(rows) < agents
        """(N,): the process runs or is paused."""
        self.awake = self.alive.copy()
        """(N,): the process runs, so the agent steps."""
        self.incarnations = [0] * rows
        self.known = agents
        """How many ids are given."""
        self.whole = agents == rows
        """Whether every row is alive."""

    @property
    def next_boot_s(self) -> float:
        """When the next agent has booted [s]; infinite when none is booting."""
        return min(self._boots_s.values()) if self._boots_s else inf

    @property
    def first(self) -> int | None:
        """The lowest id that steps."""
        return int(np.argmax(self.awake)) if self.awake.any() else None

    def state(self, agent: int) -> State:
        """Return the state of an agent's process."""
        return self._states[agent]

    def has(self, agent: int, incarnation: int | None) -> bool:
        """Return whether an agent's process exists or boots, in its incarnation (None: in any)."""
        started = self._states[agent] in STARTED
        return started and incarnation in {None, self.incarnations[agent]}

    def booted(self, time_s: float) -> AdmitAgents:
        """Return the agents that have booted by a time [s]."""
        return AdmitAgents(
            tuple(a for a, at_s in sorted(self._boots_s.items()) if at_s <= time_s + SLACK_S)
        )

    def begun(
        self, number: int, fault: ProcessFault, claims: Claims, position: Floats, time_s: float
    ) -> ProcessOperation:
        """Return what a fault means that begins now.

        position: of all vehicles (N, 3) [m; world frame].
        """
        match fault:
            case Kill() | Leave():
                agents = self._selected(number, fault.selectors, STARTED, claims)
                leaves = isinstance(fault, Leave)
                return EndProcesses(number, agents, fault.selectors, leaves)
            case Pause():
                agents = self._selected(number, fault.selectors, {State.RUNNING}, claims)
                return PauseProcesses(number, agents, fault.selectors)
            case Resume():
                agents = self._selected(number, fault.selectors, {State.PAUSED}, claims)
                return ResumeProcesses(number, agents, fault.selectors)
            case Restart():
                agents = self._selected(number, fault.selectors, ENDED, claims)
                return self._restarted(number, agents, position, time_s)
            case Join():
                return self._joined(number, fault, position, time_s)
        assert_never(fault)

    def ended(
        self, number: int, fault: ProcessFault, position: Floats, time_s: float
    ) -> ProcessOperation | None:
        """Return what the end of a fault means; None where it has nothing to undo."""
        match fault:
            case Kill() | Leave():
                agents = self._still(number, ENDED)
                return self._restarted(number, agents, position, time_s)
            case Pause():
                return ResumeProcesses(number, self._still(number, {State.PAUSED}), ())
            case Resume() | Restart() | Join():
                return None
        assert_never(fault)

    def sensor_fault(
        self, number: int, fault: SensorFault, ends: bool, claims: Claims
    ) -> SetSensorMode:
        """Return whose sensors fail now, or work again."""
        if ends:
            return SetSensorMode(number, self._struck.get(number, ()), fault.kind, None)
        agents = self._selected(number, fault.agents, KNOWN, claims)
        self._struck[number] = agents
        return SetSensorMode(number, agents, fault.kind, fault.mode)

    def apply(self, operation: ProcessOperation, time_s: float) -> None:
        """Change the states as an operation did that was carried out at a time [s]."""
        match operation:
            case EndProcesses(number=number, agents=agents):
                self._struck[number] = agents
                self._move(agents, "leave" if operation.leaves else "kill")
            case PauseProcesses(number=number, agents=agents):
                self._struck[number] = agents
                self._move(agents, "pause")
            case ResumeProcesses(agents=agents):
                self._move(agents, "resume")
            case StartProcesses(incarnations=incarnations):
                self.incarnations = [
                    incarnations.get(a, before) for a, before in enumerate(self.incarnations)
                ]
                self.known = max(self.known, *(agent + 1 for agent in incarnations), 0)
                self._boots_s |= dict.fromkeys(incarnations, time_s + self._scenario.fleet.boot_s)
                self._move(tuple(incarnations), operation.kind)
            case AdmitAgents(agents=agents):
                self._move(agents, "boot")
            case _:
                assert_never(operation)

    def exited(self, agent: int) -> None:
        """Note that an agent's process ended unplanned."""
        self._move((agent,), "exit")

    def _move(self, agents: tuple[int, ...], cause: Cause) -> None:
        for agent in agents:
            state = next_state(self._states[agent], cause)
            self._states[agent] = state
            self.alive[agent], self.awake[agent] = state in ALIVE, state is State.RUNNING
            if state is not State.BOOTING:
                self._boots_s.pop(agent, None)
        self.whole = bool(self.alive.all())

    def _in(self, states: AbstractSet[State]) -> list[int]:
        return [agent for agent in range(self.known) if self._states[agent] in states]

    def _still(self, number: int, states: AbstractSet[State]) -> tuple[int, ...]:
        """Return the agents that an event struck and that are still in a state."""
        among = self._in(states)
        return tuple(agent for agent in self._struck.get(number, ()) if agent in among)

    def _selected(
        self,
        number: int,
        selectors: Selectors,
        states: AbstractSet[State],
        claims: Claims,
    ) -> tuple[int, ...]:
        candidates = self._in(states)
        running = [agent for agent in candidates if self.awake[agent]]
        key = self._scenario.seed, number
        return selected(selectors, Candidates(candidates, running), claims, key)

    def _restarted(
        self, number: int, agents: tuple[int, ...], position: Floats, time_s: float
    ) -> StartProcesses:
        incarnations = {agent: self.incarnations[agent] + 1 for agent in agents}
        away = [agent for agent in agents if np.isnan(position[agent, 0])]
        try:
            poses = self._placement.returning(number, away, position, time_s)
        except StartError as error:
            return StartProcesses(number, "restart", {}, {}, str(error))
        return StartProcesses(number, "restart", incarnations, poses)

    def _joined(self, number: int, join: Join, position: Floats, time_s: float) -> StartProcesses:
        start = join.start or self._scenario.fleet.start
        try:
            poses = self._placement.joiners(number, start, join.count, position, time_s)
        except StartError as error:
            return StartProcesses(number, "join", {}, {}, str(error))
        agents = range(self.known, self.known + join.count)
        incarnations = dict.fromkeys(agents, 0)
        return StartProcesses(number, "join", incarnations, dict(zip(agents, poses, strict=True)))
