"""Operations: what a clock carries out between two slots.

An operation is a step of the timeline with its selectors resolved to agents. Each clock (virtual,
lockstep, free-running) matches on :data:`Operation`; a kind without a case fails the type check.
"""

from typing import Literal, NamedTuple

from agent.messages import FramePath, Vector
from agent.qstructure.formation import FormationSpec
from netem.faults import FaultOrder, OutageCause
from worldsim.scenario.faults import AgentFault, FailureMode
from worldsim.scenario.selectors import Selectors


class StartPose(NamedTuple):
    """The pose with which a vehicle enters the world."""

    position: Vector
    """[m; world frame]"""
    yaw: float
    """[rad; world frame]"""


class EndProcesses(NamedTuple):
    """End the processes of agents."""

    number: int
    """The event's number."""
    agents: tuple[int, ...]
    """In ascending order."""
    ended_before: tuple[int, ...]
    """Agents that have ended already and that this fault holds down too."""
    selectors: Selectors
    """The event's own, for its report."""
    leaves: bool
    """Whether the vehicles leave the world too; otherwise they hover."""


class PauseProcesses(NamedTuple):
    """Stop the processes of agents."""

    number: int
    """The event's number."""
    agents: tuple[int, ...]
    """In ascending order."""
    paused_before: tuple[int, ...]
    """Agents that are paused already and that this fault holds too."""
    selectors: Selectors
    """The event's own, for its report."""


class ResumeProcesses(NamedTuple):
    """Continue the stopped processes of agents."""

    number: int
    """The event's number."""
    agents: tuple[int, ...]
    """In ascending order."""
    selectors: Selectors
    """The event's own, for its report; empty at the end of a pause."""


class StartProcesses(NamedTuple):
    """Start the processes of agents."""

    number: int
    """The event's number."""
    kind: Literal["restart", "join"]
    incarnations: dict[int, int]
    """The incarnation of each agent that starts."""
    poses: dict[int, StartPose]
    """The poses of the agents whose vehicles are not in the world yet."""
    refused: str | None = None
    """The reason for which no process starts."""


class ThrottleProcesses(NamedTuple):
    """Stop and continue the processes of starved agents, which stay members of the team."""

    stops: tuple[int, ...]
    """In ascending order."""
    continues: tuple[int, ...]
    """In ascending order."""
    stopped: frozenset[int]
    """All that are stopped from now on."""


class AdmitAgents(NamedTuple):
    """Let agents step that have booted."""

    agents: tuple[int, ...]
    """In ascending order."""


class SetSensorMode(NamedTuple):
    """Let sensors of agents fail, or work again."""

    number: int
    """The event's number."""
    agents: tuple[int, ...]
    """In ascending order."""
    sensor: str | None
    """The sensor's kind; None: every sensor of the agent."""
    mode: FailureMode | None
    """None: the sensor works again."""


class DisturbAgents(NamedTuple):
    """Begin or end a fault of agents whose processes go on."""

    number: int
    """The event's number."""
    agents: tuple[int, ...]
    """In ascending order."""
    fault: AgentFault
    ends: bool

    @property
    def selectors(self) -> Selectors:
        """The event's own, for its report."""
        return self.fault.agents


class StopWorldProcess(NamedTuple):
    """Stop the world's own process."""

    number: int
    """The event's number."""
    cause: OutageCause
    for_s: float
    """How long a pause lasts [s]; of wall time at speed 1."""


class FillDisk(NamedTuple):
    """Let the disk be full for the run's recording and events, or no longer."""

    number: int
    """The event's number."""
    full: bool


class GiveMission(NamedTuple):
    """Give the team a mission, by way of one agent."""

    kind: Literal["formation", "frame"]
    """The part of the mission that is new."""
    formation: FormationSpec
    path: FramePath
    """Of the target's frame [world frame]."""
    to: int | None = None
    """The agent that gets the mission; None: the running agent with the lowest id."""
    version: int | None = None
    """The mission's version; None: the next one."""


ProcessOperation = EndProcesses | PauseProcesses | ResumeProcesses | StartProcesses | AdmitAgents
ChangeOfAgents = SetSensorMode | DisturbAgents | ThrottleProcesses
AgentOperation = ProcessOperation | ChangeOfAgents
WorldOperation = StopWorldProcess | FillDisk
Operation = AgentOperation | WorldOperation | FaultOrder | GiveMission
