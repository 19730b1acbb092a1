"""Actions of the timeline: faults of processes, sensors and agents, and missions.

An event decodes into one of these types, or into a radio fault of ``netem.faults``. Its selectors
are resolved to agents when it happens.
"""

from typing import Annotated, ClassVar, Literal

import msgspec
from msgspec import Meta

from agent.config import SensorKind, Table
from agent.qstructure.formation import FormationSpec
from netem.faults import OutageCause, RadioFault, SabotageKeys
from worldsim.scenario.selectors import Selector, Selectors
from worldsim.scenario.start import BoxStart, ListStart
from worldsim.scenario.target_frame import FrameChange

Joiners = Annotated[int, Meta(ge=1, le=1000)]
Bias = Annotated[float, Meta(ge=-1000, le=1000)]
FailureMode = Literal["stuck", "silent", "wrong"]
"""stuck: repeats the last reading; silent: gives no reading; wrong: gives arbitrary readings."""


class _Selected(msgspec.Struct, frozen=True):
    selectors: Selectors


class Kill(_Selected, frozen=True):
    """End the agents' processes; their vehicles stop and hover."""


class Leave(_Selected, frozen=True):
    """End the agents' processes, and take their vehicles out of the world."""


class Restart(_Selected, frozen=True):
    """Start agents that died or left again, each with its next incarnation."""


class Pause(_Selected, frozen=True):
    """Stop the agents' processes; a vehicle hovers when its last command has expired."""


class Resume(_Selected, frozen=True):
    """Continue the agents' paused processes."""


class StopWorld(msgspec.Struct, frozen=True):
    """Stop the world's process: for good, or for a while in which simulated time stands still."""

    cause: OutageCause
    for_s: float | None
    """How long a pause lasts [s]; of wall time at speed 1. None for a kill."""


class DiskFull(msgspec.Struct, frozen=True):
    """Let nothing more fit on the disk, for the recording and the events of the run."""


class Join(Table, frozen=True):
    """Add new agents, under the next free ids."""

    count: Joiners
    start: BoxStart | ListStart | None = None
    """Start positions of their vehicles; None: by the start of [fleet]."""


class SensorFault(Table, frozen=True):
    """Let sensors of the selected agents fail; without ``kind``, every sensor of an agent."""

    agents: Selectors
    mode: FailureMode
    kind: SensorKind | None = None


class SabotageFault(SabotageKeys[Selectors], frozen=True):
    """Let a saboteur send frames by the radios of the selected agents."""


class ClockFault(Table, frozen=True):
    """Let the clocks of the selected agents be wrong."""

    kind: ClassVar[str] = "clock"
    agents: Selectors
    offset_s: Annotated[float, Meta(ge=-86_400, le=86_400)] = 0.0
    """Added to the time that the agents read [s]."""
    drift_ppm: Annotated[float, Meta(ge=-10_000, le=10_000)] = 0.0
    """So much more for each second [1e-6]."""


class PoseFault(Table, frozen=True):
    """Let the selected agents measure their poses wrong."""

    kind: ClassVar[str] = "pose"
    agents: Selectors
    bias_m: tuple[Bias, Bias, Bias] = (0.0, 0.0, 0.0)
    """Of the measured position [m; world frame]."""
    noise_m: Annotated[float, Meta(ge=0, le=10)] = 0.0
    """Standard deviation of the measured position on each axis [m]."""
    bias_yaw_deg: Annotated[float, Meta(ge=-180, le=180)] = 0.0
    """Of the measured yaw [deg]."""


class SlowFault(Table, frozen=True):
    """Let the controllers of the selected agents be slow."""

    kind: ClassVar[str] = "slow"
    agents: Selectors
    delay_s: Annotated[float, Meta(ge=0.001, le=10)]
    """How long each step takes, beyond its own time [s; simulated time]."""


class StarveFault(Table, frozen=True):
    """Give the selected agents' processes only a share of the CPU's time."""

    kind: ClassVar[str] = "starve"
    agents: Selectors
    cpu_percent: Annotated[float, Meta(ge=1, le=99)]
    """The share of each period for which a process runs [%]."""
    period_s: Annotated[float, Meta(ge=0.05, le=10)] = 0.5
    """[s; simulated time]"""


MAX_PASSWORDS = 8
"""An intruder has at most so many; of more agents that are selected, those of the first."""


class Intruder(Table, frozen=True):
    """Let a process outside the fleet attack its router.

    With agents it has their passwords, of MAX_PASSWORDS at most, and puts messages on all keys that
    these agents may write to. Without any it opens connections and sends noise.
    """

    kind: ClassVar[str] = "intruder"
    agents: Annotated[tuple[Selector, ...], Meta(max_length=1000)] = ()
    per_s: Annotated[float, Meta(ge=1, le=20_000)] | None = None
    """Messages on each key, or connections [1/s; wall time]; None: 10 000, or 200 connections."""

    @property
    def rate(self) -> float:
        """Messages on each key, or connections [1/s; wall time]."""
        return self.per_s if self.per_s is not None else 1e4 if self.agents else 200.0


class EndFault(msgspec.Struct, frozen=True):
    """End a fault before its time, or one that has no end."""

    fault: str
    """Its name."""


FaultOfEach = ClockFault | PoseFault | SlowFault | StarveFault
"""A fault that strikes each of its agents by itself."""
AgentFault = FaultOfEach | Intruder
"""A fault of single agents whose processes go on."""
ProcessFault = Kill | Leave | Restart | Pause | Resume | Join
MissionChange = FormationSpec | FrameChange
FaultOfAgents = SensorFault | SabotageFault | AgentFault
FaultOfWorld = StopWorld | DiskFull
Action = RadioFault | ProcessFault | FaultOfWorld | FaultOfAgents | MissionChange | EndFault
"""The action of one event."""
