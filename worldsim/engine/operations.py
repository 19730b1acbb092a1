"""What a clock carries out between slots: events of the timeline, with the agents they mean.

Each clock (virtual, lockstep, free-running) matches on :data:`Operation`; a kind that a clock
forgets fails the type check.
"""

from typing import Literal, NamedTuple

from agent.messages import FramePath, Vector
from agent.qstructure.formation import FormationSpec
from netem.faults import FaultOrder
from worldsim.scenario.faults import FailureMode, Selectors


class StartPose(NamedTuple):
    """Where a vehicle enters the world."""

    position: Vector
    """[m; world frame]"""
    yaw: float
    """[rad; world frame]"""


class EndProcesses(NamedTuple):
    """These agents' processes end now."""

    number: int
    agents: tuple[int, ...]
    selectors: Selectors
    leaves: bool
    """Whether their vehicles leave the world too; otherwise they hover."""


class PauseProcesses(NamedTuple):
    """These agents' processes are stopped now."""

    number: int
    agents: tuple[int, ...]
    selectors: Selectors


class ResumeProcesses(NamedTuple):
    """These agents' stopped processes go on now."""

    number: int
    agents: tuple[int, ...]
    selectors: Selectors


class StartProcesses(NamedTuple):
    """These agents' processes start now."""

    number: int
    kind: Literal["restart", "join"]
    incarnations: dict[int, int]
    """Each agent's incarnation."""
    poses: dict[int, StartPose]
    """Of the agents whose vehicle is not in the world."""
    refused: str | None = None
    """Why no process starts."""


class AdmitAgents(NamedTuple):
    """These agents have booted: they step from now on."""

    agents: tuple[int, ...]


class SetSensorMode(NamedTuple):
    """These agents' sensors fail, or work again."""

    number: int
    agents: tuple[int, ...]
    sensor: str | None
    """Its kind; None: every sensor that they have."""
    mode: FailureMode | None
    """None: it works again."""


class GiveMission(NamedTuple):
    """The team gets a formation, or a frame, by way of one agent."""

    kind: Literal["formation", "frame"]
    """What is new."""
    formation: FormationSpec
    path: FramePath
    to: int | None = None
    """The agent that it is given to; None: the lowest id."""
    version: int | None = None
    """The mission's own; None: the next."""


ProcessOperation = EndProcesses | PauseProcesses | ResumeProcesses | StartProcesses | AdmitAgents
Operation = ProcessOperation | SetSensorMode | FaultOrder | GiveMission
