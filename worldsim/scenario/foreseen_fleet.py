"""The fleet that each event of a timeline meets, as far as it can be foreseen.

Selectors that depend on claims or on draws are resolved when their event happens: of the agents
that they select, only the number is foreseen.
"""

from typing import NamedTuple, assert_never

from agent.qstructure.formation import Formation, FormationSpec, formation_of
from netem.faults import Heal, Partition, RadioFault
from worldsim.scenario.faults import (
    AgentFault,
    DiskFull,
    EndFault,
    Join,
    Kill,
    Leave,
    Pause,
    Restart,
    Resume,
    SabotageFault,
    SensorFault,
    StopWorld,
)
from worldsim.scenario.selectors import (
    AllAgents,
    OneAgent,
    OtherProcess,
    QueueAgents,
    RandomAgents,
    Selectors,
    VertexAgent,
    parsed,
)
from worldsim.scenario.tables import Scenario
from worldsim.scenario.target_frame import FrameChange, FrameTable, changed_frame
from worldsim.scenario.timeline import Step

UNKNOWN_NUMBER = -1
"""Stands for the event of a partition in force whose number is not known."""


class FleetNow(NamedTuple):
    """The state of a fleet that an operator's event meets."""

    formation: FormationSpec
    frame: FrameTable
    partitioned: bool
    """Whether a partition is in force."""
    id_count: int
    """Number of ids in use."""
    running: frozenset[int]
    """The agents that are running."""
    room: int
    """Number of rows that no joining agent uses."""


class ForeseenFleet:
    """The state of the fleet after the steps applied so far."""

    def __init__(self, scenario: Scenario, now: FleetNow | None = None) -> None:
        agents = scenario.fleet.agents
        self._spacing_m = scenario.control.spacing_m
        self.id_count = now.id_count if now is not None else agents
        """Number of ids in use."""
        self.frame = now.frame if now is not None else scenario.frame
        self.spec = now.formation if now is not None else scenario.formation
        self.formation = self.made(self.spec)
        self._running = set(now.running if now is not None else range(agents))
        self._fewer = 0
        """Number of running agents that were lost to selectors resolved later."""
        partitioned = now is not None and now.partitioned
        self._partitions = {UNKNOWN_NUMBER} if partitioned else set()

    @property
    def team(self) -> int:
        """Number of agents that are running."""
        return max(0, len(self._running) - self._fewer)

    @property
    def partitioned(self) -> bool:
        """Whether a partition is in force."""
        return bool(self._partitions)

    def made(self, spec: FormationSpec) -> Formation:
        """Return a formation with the scenario's spacing. Raises FormationError."""
        return formation_of(spec, self._spacing_m)

    def apply(self, step: Step) -> None:
        """Apply a valid step."""
        action = step.event.action
        if isinstance(action, RadioFault):
            self._apply_radio(step, action)
            return
        if isinstance(action, AgentFault):
            return  # the agents' processes go on
        match action:
            case Kill() | Leave() | Pause():
                self._change_team(action.selectors, back=step.ends)
            case Restart() | Resume():
                self._change_team(action.selectors, back=True)
            case Join():
                self._running.update(range(self.id_count, self.id_count + action.count))
                self.id_count += action.count
            case FrameChange():
                self.frame = changed_frame(self.frame, action, step.at_s)
            case FormationSpec():
                self.spec, self.formation = action, self.made(action)
            case SensorFault() | SabotageFault() | StopWorld() | DiskFull() | EndFault():
                pass  # an event that ends a fault puts the fault's end into the timeline
            case _:
                assert_never(action)

    def _apply_radio(self, step: Step, fault: RadioFault) -> None:
        """Of the radio's faults only partitions matter: a heal needs one."""
        if isinstance(fault, Heal):
            self._partitions.clear()
        elif isinstance(fault, Partition):
            (self._partitions.discard if step.ends else self._partitions.add)(step.number)

    def _change_team(self, selectors: Selectors, back: bool) -> None:
        """Remove the selected agents from the team, or bring them back."""
        for selector in selectors:
            kind = parsed(selector)
            match kind:
                case OneAgent(agent):
                    (self._running.add if back else self._running.discard)(agent)
                case AllAgents():
                    self._running = set(range(self.id_count)) if back else set()
                    self._fewer = 0
                case RandomAgents() | VertexAgent() | QueueAgents():
                    number = self._number(kind)
                    self._fewer = max(0, self._fewer + (-number if back else number))
                case OtherProcess():
                    pass  # every agent stays
                case _:
                    assert_never(kind)

    def _number(self, selector: RandomAgents | VertexAgent | QueueAgents) -> int:
        """Return how many agents a selector selects when every agent is in its place."""
        match selector:
            case RandomAgents(number):
                return number
            case VertexAgent():
                return 1
            case QueueAgents(name):
                index = [queue.name for queue in self.spec.queue].index(name)
                places = self.formation.layout(self.team).places
                return sum(index in self.formation.queues_of(place) for place in places)
        assert_never(selector)
