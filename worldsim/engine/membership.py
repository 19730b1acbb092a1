"""The team's membership: the state of each agent's process, and the agents that an event selects.

A row belongs to one agent for the whole run; the rows of agents that have not joined come last.
"""

from collections.abc import Set as AbstractSet
from math import inf
from typing import assert_never

import numpy as np

from worldsim.engine.fault_holds import FaultHolds
from worldsim.engine.operations import (
    AdmitAgents,
    DisturbAgents,
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
    MAX_PASSWORDS,
    AgentFault,
    Intruder,
    Join,
    Kill,
    Leave,
    Pause,
    ProcessFault,
    Restart,
    Resume,
    SensorFault,
)
from worldsim.scenario.selectors import AllAgents, OneAgent, Selectors, parsed
from worldsim.scenario.tables import Scenario
from worldsim.scenario.timeline import SLACK_S
from worldsim.truth.start_positions import StartError
from worldsim.truth.vehicle import Floats


class Membership:
    """The state of every agent's process; row i = agent i."""

    def __init__(self, scenario: Scenario) -> None:
        agents, rows = scenario.fleet.agents, scenario.rows
        self._scenario = scenario
        self._placement = Placement(scenario)
        self._states = [State.RUNNING] * agents + [State.ABSENT] * (rows - agents)
        self._boots_s: dict[int, float] = {}
        """When each booting agent has booted [s; simulated time]."""
        self._ended_by, self._paused_by = FaultHolds(), FaultHolds()
        self._struck_by: dict[int, tuple[int, ...]] = {}
        """The agents that a fault of sensors, or of agents, struck, by its number."""
        self.alive = np.arange(rows) < agents
        """(N,): whether the process is running or paused."""
        self.running = self.alive.copy()
        """(N,): whether the process is running, so that the agent steps."""
        self.incarnations = [0] * rows
        self.id_count = agents
        """Number of ids in use: 0 to id_count - 1."""
        self.all_alive = agents == rows
        """Whether every row is alive."""

    @property
    def next_boot_s(self) -> float:
        """When the next agent has booted [s; simulated time]; infinite when none is booting."""
        return min(self._boots_s.values()) if self._boots_s else inf

    @property
    def first_running(self) -> int | None:
        """The lowest id of a running agent."""
        return int(np.argmax(self.running)) if self.running.any() else None

    def state(self, agent: int) -> State:
        """Return the state of an agent's process."""
        return self._states[agent]

    def has_process(self, agent: int, incarnation: int | None) -> bool:
        """Return whether an agent's process of this incarnation (None: any) is started."""
        started = self._states[agent] in STARTED
        return started and incarnation in {None, self.incarnations[agent]}

    def admission(self, time_s: float) -> AdmitAgents:
        """Return the operation that admits the agents that have booted by a time [s]."""
        return AdmitAgents(
            tuple(a for a, at_s in sorted(self._boots_s.items()) if at_s <= time_s + SLACK_S)
        )

    def begin_operation(
        self, number: int, fault: ProcessFault, claims: Claims, position: Floats, time_s: float
    ) -> ProcessOperation:
        """Return the operation that begins a fault now.

        position: of all vehicles (N, 3) [m; world frame].
        """
        match fault:
            case Kill():
                agents = self._selected(number, fault.selectors, STARTED, claims)
                ended = self._named(fault.selectors, ENDED)
                return EndProcesses(number, agents, ended, fault.selectors, leaves=False)
            case Leave():
                agents = self._selected(number, fault.selectors, STARTED, claims)
                ended = self._named(fault.selectors, ENDED)
                return EndProcesses(number, agents, ended, fault.selectors, leaves=True)
            case Pause():
                agents = self._selected(number, fault.selectors, {State.RUNNING}, claims)
                paused = self._named(fault.selectors, {State.PAUSED})
                return PauseProcesses(number, agents, paused, fault.selectors)
            case Resume():
                agents = self._selected(number, fault.selectors, {State.PAUSED}, claims)
                return ResumeProcesses(number, agents, fault.selectors)
            case Restart():
                agents = self._selected(number, fault.selectors, ENDED, claims)
                return self._restart(number, agents, position, time_s)
            case Join():
                return self._join(number, fault, position, time_s)
        assert_never(fault)

    def end_operation(
        self, number: int, fault: ProcessFault, position: Floats, time_s: float
    ) -> ProcessOperation | None:
        """Return the operation that undoes a fault; None where there is nothing to undo."""
        match fault:
            case Kill() | Leave():
                agents = self._among(self._ended_by.end(number), ENDED)
                return self._restart(number, agents, position, time_s) if agents else None
            case Pause():
                agents = self._among(self._paused_by.end(number), {State.PAUSED})
                return ResumeProcesses(number, agents, ()) if agents else None
            case Resume() | Restart() | Join():
                return None
        assert_never(fault)

    def sensor_fault(
        self, number: int, fault: SensorFault, ends: bool, claims: Claims
    ) -> SetSensorMode:
        """Return the operation that begins or ends a sensor fault now."""
        if ends:
            return SetSensorMode(number, self._struck_by.pop(number, ()), fault.kind, None)
        agents = self._selected(number, fault.agents, KNOWN, claims)
        self._struck_by[number] = agents
        return SetSensorMode(number, agents, fault.kind, fault.mode)

    def victims(self, number: int, selectors: Selectors, claims: Claims) -> tuple[int, ...]:
        """Return the agents whose radios an event's saboteur uses.

        The medium keeps a radio off while its agent is dead or gone: it is used once it is back.
        """
        return self._selected(number, selectors, KNOWN, claims)

    def agent_fault(
        self, number: int, fault: AgentFault, ends: bool, claims: Claims
    ) -> DisturbAgents:
        """Return the operation that begins or ends a fault of agents now."""
        if ends:
            return DisturbAgents(number, self._struck_by.pop(number, ()), fault, ends=True)
        agents = self._selected(number, fault.agents, KNOWN, claims)
        if isinstance(fault, Intruder):
            agents = agents[:MAX_PASSWORDS]
        self._struck_by[number] = agents
        return DisturbAgents(number, agents, fault, ends=False)

    def apply(self, operation: ProcessOperation, time_s: float) -> None:
        """Apply an operation that was carried out at a time [s] to the states."""
        match operation:
            case EndProcesses(agents=agents):
                self._ended_by.begin(operation.number, agents + operation.ended_before)
                self._move(agents, "leave" if operation.leaves else "kill")
            case PauseProcesses(agents=agents):
                self._paused_by.begin(operation.number, agents + operation.paused_before)
                self._move(agents, "pause")
            case ResumeProcesses(agents=agents):
                self._paused_by.release(agents)
                self._move(agents, "resume")
            case StartProcesses(incarnations=incarnations):
                self._ended_by.release(tuple(incarnations))
                self._paused_by.release(tuple(incarnations))
                self.incarnations = [
                    incarnations.get(a, before) for a, before in enumerate(self.incarnations)
                ]
                self.id_count = max(self.id_count, *(agent + 1 for agent in incarnations), 0)
                self._boots_s |= dict.fromkeys(incarnations, time_s + self._scenario.fleet.boot_s)
                self._move(tuple(incarnations), operation.kind)
            case AdmitAgents(agents=agents):
                self._move(agents, "boot")
            case _:
                assert_never(operation)

    def record_exit(self, agent: int) -> None:
        """Record that an agent's process ended unplanned."""
        self._move((agent,), "exit")

    def _move(self, agents: tuple[int, ...], cause: Cause) -> None:
        for agent in agents:
            state = next_state(self._states[agent], cause)
            self._states[agent] = state
            self.alive[agent], self.running[agent] = state in ALIVE, state is State.RUNNING
            if state is not State.BOOTING:
                self._boots_s.pop(agent, None)
        self.all_alive = bool(self.alive.all())

    def _in(self, states: AbstractSet[State]) -> list[int]:
        return [agent for agent in range(self.id_count) if self._states[agent] in states]

    def _among(self, agents: tuple[int, ...], states: AbstractSet[State]) -> tuple[int, ...]:
        """Return those of some agents that are in one of the states."""
        return tuple(agent for agent in agents if self._states[agent] in states)

    def _named(self, selectors: Selectors, states: AbstractSet[State]) -> tuple[int, ...]:
        """Return the agents in a state that are selected by id or by "all"."""
        kinds = [parsed(selector) for selector in selectors]
        ids = {kind.id for kind in kinds if isinstance(kind, OneAgent)}
        everyone = any(isinstance(kind, AllAgents) for kind in kinds)
        return tuple(agent for agent in self._in(states) if everyone or agent in ids)

    def _selected(
        self,
        number: int,
        selectors: Selectors,
        states: AbstractSet[State],
        claims: Claims,
    ) -> tuple[int, ...]:
        candidates = self._in(states)
        running = [agent for agent in candidates if self.running[agent]]
        key = self._scenario.seed, number
        return selected(selectors, Candidates(candidates, running), claims, key)

    def _restart(
        self, number: int, agents: tuple[int, ...], position: Floats, time_s: float
    ) -> StartProcesses:
        incarnations = {agent: self.incarnations[agent] + 1 for agent in agents}
        without_vehicle = [agent for agent in agents if np.isnan(position[agent, 0])]
        try:
            poses = self._placement.returning(number, without_vehicle, position, time_s)
        except StartError as error:
            return StartProcesses(number, "restart", {}, {}, refused=str(error))
        return StartProcesses(number, "restart", incarnations, poses)

    def _join(self, number: int, join: Join, position: Floats, time_s: float) -> StartProcesses:
        start = join.start or self._scenario.fleet.start
        try:
            poses = self._placement.joiners(number, start, join.count, position, time_s)
        except StartError as error:
            return StartProcesses(number, "join", {}, {}, refused=str(error))
        agents = range(self.id_count, self.id_count + join.count)
        incarnations = dict.fromkeys(agents, 0)
        return StartProcesses(number, "join", incarnations, dict(zip(agents, poses, strict=True)))
