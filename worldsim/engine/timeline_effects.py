"""The timeline's effects: from a step to an operation, and from an operation to state and events.

A clock takes the operations that are due and carries each out on its processes and its medium.
Then it is applied here: to the members, the radio's conditions, the sensors and the missions.
"""

from collections.abc import Callable, Iterator
from typing import Literal, assert_never

from agent.messages import MEMBER, NO_MISSION
from agent.qstructure.formation import FormationSpec, formation_of
from netem.conditions import NetworkConditions
from netem.faults import FaultOrder, RadioFault, Sabotage
from worldsim.engine.agent_fault_effects import AgentFaultEffects
from worldsim.engine.fault_reports import FaultReports
from worldsim.engine.membership import Membership
from worldsim.engine.missions import Missions
from worldsim.engine.operations import (
    AdmitAgents,
    ChangeOfAgents,
    DisturbAgents,
    EndProcesses,
    FillDisk,
    GiveMission,
    Operation,
    PauseProcesses,
    ResumeProcesses,
    SetSensorMode,
    StartProcesses,
    StopWorldProcess,
    ThrottleProcesses,
)
from worldsim.engine.selection import Claims
from worldsim.engine.slow_controllers import SlowControllers
from worldsim.engine.starvation import Starvation
from worldsim.judge.event import By
from worldsim.judge.radio_events import applied
from worldsim.judge.run_events import (
    NOBODY_TO_RESTART,
    WORKS_AGAIN,
    DiskFilled,
    FormationGiven,
    FrameGiven,
    Joined,
    Killed,
    Left,
    Paused,
    Reconnected,
    Restarted,
    Resumed,
    RunEvent,
    SensorChanged,
    WorldStopped,
)
from worldsim.scenario.faults import (
    AgentFault,
    DiskFull,
    EndFault,
    Join,
    Kill,
    Leave,
    Pause,
    ProcessFault,
    Restart,
    Resume,
    SabotageFault,
    SensorFault,
    StopWorld,
)
from worldsim.scenario.tables import Scenario
from worldsim.scenario.target_frame import FrameChange
from worldsim.scenario.timeline import SLACK_S, Step, Timeline
from worldsim.truth.world import World

Emit = Callable[[RunEvent], None]


class TimelineEffects:
    """The effects of the timeline and of an operator on a fleet."""

    def __init__(
        self, scenario: Scenario, world: World, emit: Emit, slow_modelled: bool = True
    ) -> None:
        self.timeline = Timeline(scenario)
        self.members = Membership(scenario)
        self.network = NetworkConditions(scenario.netem)
        self.missions = Missions(scenario)
        self.faults = FaultReports()
        self.places: list[tuple[int, int] | None] = [None] * scenario.rows
        """The place (queue, rank) that each agent claims, as last reported; row i = agent i."""
        self.roles = [MEMBER] * scenario.rows
        """The role of each agent, as last reported: an index of ROLES."""
        self._spacing_m = scenario.control.spacing_m
        self._formation = formation_of(scenario.formation, self._spacing_m)
        self.slow = SlowControllers(world.clock, slow_modelled)
        self.starvation = Starvation()
        self._agent_faults = AgentFaultEffects(world, self.slow, self.starvation)
        self._world = world
        self._emit = emit

    @property
    def addressee(self) -> int | None:
        """The agent that gets the newest mission.

        If the mission's own agent is not running, the running agent with the lowest id.
        """
        to = self.missions.to
        running = to is not None and self.members.running[to]
        return to if running else self.members.first_running

    def due(self) -> Iterator[Operation]:
        """Yield the operations before the present slot; apply each before taking the next."""
        time_s = self._world.time_s
        for step in self.timeline.due(time_s):
            operation = self.operation(step)
            if step.ends:
                self.faults.end(step.number, self._t_s)
            if operation is not None:
                yield operation
        if self.members.next_boot_s <= time_s + SLACK_S:
            yield self.members.admission(time_s)
        if self.starvation:
            throttle = self.starvation.change(time_s, self.members.running)
            if throttle is not None:
                yield throttle

    def nothing_due(self) -> bool:
        """Return whether no operation is due before the present slot."""
        next_s = min(self.timeline.next_s, self.members.next_boot_s)
        return next_s > self._world.time_s + SLACK_S and not self.starvation

    def operation(self, step: Step) -> Operation | None:
        """Return the operation of a step now; None where there is nothing to do or to undo."""
        action, number = step.event.action, step.number
        if isinstance(action, SabotageFault):
            action = self._sabotage(number, action)
        if isinstance(action, RadioFault):
            return self._fault_order(step, action)
        if isinstance(action, AgentFault):
            return self.members.agent_fault(number, action, step.ends, self._claims)
        match action:
            case Kill() | Leave() | Restart() | Pause() | Resume() | Join():
                return self._process_operation(step, action)
            case SensorFault():
                return self.members.sensor_fault(number, action, step.ends, self._claims)
            case FormationSpec() | FrameChange() if not step.ends:
                return self.missions.changed(action, step.at_s)
            case FormationSpec() | FrameChange() | EndFault() | StopWorld() | DiskFull():
                # An event that ends a fault put the fault's end into the timeline.
                return _of_world(step)
        assert_never(action)

    def apply(self, operation: Operation, by: By = None) -> None:
        """Apply an operation that was carried out, and emit its events."""
        by = self.asked_by(operation, by)
        self.faults.take(operation, self._t_s, by, self.network.conditions)
        match operation:
            case EndProcesses():
                self._end(operation, by)
            case PauseProcesses() | ResumeProcesses():
                self._pause(operation, by)
            case StartProcesses():
                self._start(operation, by)
            case AdmitAgents():
                self.members.apply(operation, self._world.time_s)
            case SetSensorMode() | DisturbAgents() | ThrottleProcesses():
                self._apply_to_agents(operation, by)
            case FaultOrder() | StopWorldProcess() | FillDisk():
                self._emit(self._applied(operation, by))
            case GiveMission():
                self._give(operation, by)
            case _:
                assert_never(operation)

    def _applied(self, operation: FaultOrder | StopWorldProcess | FillDisk, by: By) -> RunEvent:
        """Apply an order to the radio, or a fault of the world; return its event."""
        if isinstance(operation, FaultOrder):
            return applied(operation, self.network, self._t_s, by)
        if isinstance(operation, FillDisk):
            over = not operation.full
            return DiskFilled(
                t_s=self._t_s, agent=None, planned=True, by=by, over=over, number=operation.number
            )
        return WorldStopped(
            t_s=self._t_s,
            agent=None,
            planned=True,
            by=by,
            cause=operation.cause,
            number=operation.number,
        )

    def _apply_to_agents(self, operation: ChangeOfAgents, by: By) -> None:
        match operation:
            case SetSensorMode():
                self._set_sensors(operation, by)
            case DisturbAgents():
                self._disturb(operation, by)
            case ThrottleProcesses():
                self.starvation.apply(operation)
            case _:
                assert_never(operation)

    def asked_by(self, operation: Operation, by: By = None) -> By:
        """Return who asked for an operation; None: the scenario.

        by: who asks for it now. Otherwise a fault that the timeline lets happen again, or end, is
        by whoever began it.
        """
        if by is not None or isinstance(operation, AdmitAgents | ThrottleProcesses | GiveMission):
            return by
        return "operator" if self.timeline.is_operators(operation.number) else None

    def reconnect(self, after_s: float = 0.0, missing: tuple[int, ...] = ()) -> None:
        """Report that every agent is observed again, but for those that are missing.

        after_s: since the end of the outage [s; simulated time].
        """
        after_s = round(after_s, 6)
        self._emit(Reconnected(t_s=self._t_s, agent=None, after_s=after_s, missing=missing))

    def record_exit(self, agent: int, signal: int | None, status: int | None) -> None:
        """Record that an agent's process ended unplanned, by a signal or with a status."""
        self.members.record_exit(agent)
        self._forget(agent)
        self._emit(Killed(t_s=self._t_s, agent=agent, planned=False, signal=signal, status=status))

    def _forget(self, agent: int) -> None:
        """Expect nothing of a process that has ended."""
        self.slow.forget(agent)
        self.starvation.forget(agent)

    @property
    def _t_s(self) -> float:
        """The time of an event that happens now [s]."""
        return round(self._world.time_s, 6)

    @property
    def _claims(self) -> Claims:
        return Claims(self.places, self._formation)

    def _fault_order(self, step: Step, fault: RadioFault) -> FaultOrder | None:
        if not step.ends:
            return FaultOrder.begin(step.number, step.at_s, fault)
        order = FaultOrder(step.number, step.at_s)
        return order if self.network.ends(order) else None

    def _sabotage(self, number: int, fault: SabotageFault) -> Sabotage:
        """Return sabotage of the agents that its selectors select now."""
        return Sabotage(
            kind=fault.kind,
            agents=self.members.victims(number, fault.agents, self._claims),
            per_s=fault.per_s,
            delay_s=fault.delay_s,
        )

    def _process_operation(self, step: Step, fault: ProcessFault) -> Operation | None:
        position, time_s = self._world.vehicles.position, self._world.time_s
        if step.ends:
            return self.members.end_operation(step.number, fault, position, time_s)
        return self.members.begin_operation(step.number, fault, self._claims, position, time_s)

    def _end(self, operation: EndProcesses, by: By) -> None:
        self.members.apply(operation, self._world.time_s)
        for agent in operation.agents:
            self._forget(agent)
            if operation.leaves:
                self._world.leave(agent)
        self._report(Left if operation.leaves else Killed, operation, by)

    def _pause(self, operation: PauseProcesses | ResumeProcesses, by: By) -> None:
        self.members.apply(operation, self._world.time_s)
        for agent in operation.agents:
            self.starvation.forget(agent)
        paused = isinstance(operation, PauseProcesses)
        self._report(Paused if paused else Resumed, operation, by)

    def _report(
        self,
        event: type[Killed | Left | Paused | Resumed],
        operation: EndProcesses | PauseProcesses | ResumeProcesses,
        by: By,
    ) -> None:
        """Emit an event for each agent, or one event where the selectors select none."""
        number, t_s = operation.number, self._t_s
        for agent in operation.agents:
            self._emit(event(t_s=t_s, agent=agent, planned=True, by=by, number=number))
        if not operation.agents:
            nobody = operation.selectors
            self._emit(
                event(t_s=t_s, agent=None, planned=True, by=by, number=number, nobody=nobody)
            )

    def _start(self, operation: StartProcesses, by: By) -> None:
        self.members.apply(operation, self._world.time_s)
        for agent, pose in operation.poses.items():
            self._world.enter(agent, pose.position, pose.yaw)
        event = _start_event(operation.kind)
        for agent, incarnation in operation.incarnations.items():
            self.places[agent], self.roles[agent] = None, MEMBER
            self.missions.report(agent, NO_MISSION, self._world.time_s)
            self._emit(
                event(t_s=self._t_s, agent=agent, planned=True, by=by, incarnation=incarnation)
            )
        if not operation.incarnations:
            refused, number = operation.refused, None
            if refused is None:
                refused, number = NOBODY_TO_RESTART, operation.number
            self._emit(
                event(
                    t_s=self._t_s, agent=None, planned=True, by=by, number=number, refused=refused
                )
            )

    def _set_sensors(self, operation: SetSensorMode, by: By) -> None:
        sensor, mode = operation.sensor or "all", operation.mode or WORKS_AGAIN
        for agent in operation.agents:
            if operation.mode is None:
                self._world.sensor_faults.end(operation.number, agent)
            else:
                self._world.sensor_faults.begin(
                    operation.number, agent, operation.sensor, operation.mode
                )
            self._emit(
                SensorChanged(
                    t_s=self._t_s,
                    agent=agent,
                    planned=True,
                    by=by,
                    sensor=sensor,
                    mode=mode,
                    number=operation.number,
                )
            )

    def _disturb(self, operation: DisturbAgents, by: By) -> None:
        for event in self._agent_faults.apply(operation, self._t_s, by):
            self._emit(event)

    def _give(self, mission: GiveMission, by: By) -> None:
        key = self.missions.issue(mission)
        self._formation = formation_of(mission.formation, self._spacing_m)
        event = _mission_event(mission.kind)
        self._emit(
            event(
                t_s=self._t_s,
                agent=self.addressee,
                planned=True,
                by=by,
                formation=mission.formation.name,
                mission=key,
                path=mission.path,
                tables=mission.formation,
            )
        )


def _of_world(step: Step) -> StopWorldProcess | FillDisk | None:
    """Return the operation of a fault of the world or its disk; None for other steps."""
    action = step.event.action
    if isinstance(action, DiskFull):
        return FillDisk(step.number, not step.ends)
    if step.ends or not isinstance(action, StopWorld):
        return None
    return StopWorldProcess(step.number, action.cause, action.for_s or 0.0)


def _start_event(kind: Literal["restart", "join"]) -> type[Restarted | Joined]:
    match kind:
        case "restart":
            return Restarted
        case "join":
            return Joined
    assert_never(kind)


def _mission_event(kind: Literal["formation", "frame"]) -> type[FormationGiven | FrameGiven]:
    match kind:
        case "formation":
            return FormationGiven
        case "frame":
            return FrameGiven
    assert_never(kind)
