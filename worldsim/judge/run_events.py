"""Run events: everything that a run reports, one line each in events.jsonl and the recording.

``kind`` is the event's key. The judge, the recorder and readers of a run get the same events.
"""

from math import hypot
from typing import get_args

import msgspec

from agent.messages import ZERO, FramePath, Role, Vector
from agent.qstructure.formation import FormationSpec
from netem.faults import OutageCause
from worldsim.judge.event import Event, PlannedEvent
from worldsim.judge.radio_events import RadioRunEvent


class ProcessEvent(PlannedEvent, frozen=True, kw_only=True):
    """A change of an agent's process; without an agent where the selectors selected none."""

    number: int | None = None
    """The event's number; None for an unplanned exit."""
    nobody: tuple[int | str, ...] | None = None
    """The selectors, where they selected no agent."""


class Killed(ProcessEvent, frozen=True, tag="kill"):
    """An agent's process ended; its vehicle hovers."""

    signal: int | None = None
    """The signal that ended it, where that was unplanned."""
    status: int | None = None
    """Its exit status, where its end was unplanned."""


class Left(ProcessEvent, frozen=True, tag="leave"):
    """An agent's process ended, and its vehicle left the world."""


class Paused(ProcessEvent, frozen=True, tag="pause"):
    """An agent's process was stopped."""


class Resumed(ProcessEvent, frozen=True, tag="resume"):
    """An agent's stopped process continued."""


NOBODY_TO_RESTART = "no agent to restart"


class StartEvent(PlannedEvent, frozen=True, kw_only=True):
    """An agent's process started; without an agent where the start was refused."""

    incarnation: int | None = None
    refused: str | None = None
    """The reason for which no process started."""
    number: int | None = None
    """The event's number, where it found nobody to restart; None in an older recording."""


class Restarted(StartEvent, frozen=True, tag="restart"):
    """An agent that had died or left started again."""


class Joined(StartEvent, frozen=True, tag="join"):
    """A new agent started."""


WORKS_AGAIN = "works again"


class SensorChanged(PlannedEvent, frozen=True, kw_only=True, tag="sensor"):
    """An agent's sensor fails, or works again."""

    sensor: str
    """The sensor's kind, or "all"."""
    mode: str
    """stuck, silent, wrong, or WORKS_AGAIN."""
    number: int | None = None
    """The fault's number; None in an older recording."""


class AgentFaultEvent(PlannedEvent, frozen=True, kw_only=True):
    """A fault of an agent whose process goes on, or its end."""

    number: int
    """The fault's number."""
    ends: bool = False

    @property
    def over_s(self) -> float:
        """When what an end ends is over; its own time as a rule [s; simulated time].

        It is the one answer to that question: whatever is asked of a team after a fault, is asked
        from then on.
        """
        return self.t_s


class ClockChanged(AgentFaultEvent, frozen=True, tag="clock"):
    """An agent's clock goes wrong by the values of a fault, or no more."""

    offset_s: float = 0.0
    """[s]"""
    drift_ppm: float = 0.0
    """[1e-6]"""


class PoseChanged(AgentFaultEvent, frozen=True, tag="pose"):
    """An agent measures its pose wrong by the values of a fault, or no more."""

    bias_m: Vector = ZERO
    """Of the position [m; world frame]."""
    noise_m: float = 0.0
    """Standard deviation on each axis [m]."""
    bias_yaw_deg: float = 0.0
    """[deg]"""

    @property
    def displaces_m(self) -> float:
        """How far the vehicle may be from where its agent takes it to be [m]."""
        return hypot(*self.bias_m) + 3.0 * self.noise_m


class SlowChanged(AgentFaultEvent, frozen=True, tag="slow"):
    """An agent's steps take a time by the value of a fault, or no more."""

    delay_s: float = 0.0
    """[s]"""

    @property
    def over_s(self) -> float:
        """When it is over: a step that was begun before its end takes its time after it."""
        return self.t_s + self.delay_s if self.ends else self.t_s


class Starved(AgentFaultEvent, frozen=True, tag="starve"):
    """An agent's process gets only a share of the CPU's time by a fault, or no more."""

    cpu_percent: float = 0.0
    period_s: float = 0.0
    """[s]"""

    @property
    def stops_s(self) -> float:
        """For how long the process is stopped in each period [s]."""
        return (1.0 - 0.01 * self.cpu_percent) * self.period_s


class Intruded(PlannedEvent, frozen=True, kw_only=True, tag="intruder"):
    """A process outside the fleet began to attack the router, or ended."""

    number: int
    """The fault's number."""
    agents: tuple[int, ...] | None
    """Whose passwords it has; none: it has no password; None: it ended."""
    per_s: float
    """Messages on each key, or connections [1/s; wall time]."""
    nobody: tuple[int | str, ...] | None = None
    """The selectors, where they selected no agent."""


class MissionEvent(PlannedEvent, frozen=True, kw_only=True):
    """A mission was given to an agent."""

    formation: str
    """The formation's name."""
    mission: int
    """The mission's key."""
    path: FramePath
    """Of the target's frame [world frame]."""
    tables: FormationSpec
    """The formation."""


class FormationGiven(MissionEvent, frozen=True, tag="formation"):
    """A mission with a new formation was given."""


class FrameGiven(MissionEvent, frozen=True, tag="frame"):
    """A mission with a new frame was given."""


class SlotChanged(Event, frozen=True, kw_only=True, tag="slot"):
    """An agent claims another place."""

    place: tuple[int, int] | None
    """Queue and rank; None: it claims no place."""
    before: tuple[int, int] | None
    """The place that it claimed before."""


class QueueChanged(Event, frozen=True, kw_only=True, tag="queue"):
    """An agent changed its queue."""

    queue: int | None
    """The queue's index; None: it claims no place."""


class RoleChanged(Event, frozen=True, kw_only=True, tag="role"):
    """An agent took another role in the hierarchy of its queue."""

    role: Role


class ControllerLogged(Event, frozen=True, kw_only=True, tag="log"):
    """A controller wrote a line into its log."""

    text: str


class WorldStopped(PlannedEvent, frozen=True, kw_only=True, tag="world_outage"):
    """The world's process was stopped: simulated time stands still, or the run ends."""

    cause: OutageCause
    number: int | None = None
    """The fault's number; None in an older recording."""


class DiskFilled(PlannedEvent, frozen=True, kw_only=True, tag="disk_full"):
    """Nothing more of recording and events can be written, or all can again."""

    over: bool = False
    number: int | None = None
    """The fault's number; None in an older recording."""


class Reconnected(Event, frozen=True, kw_only=True, tag="reconnect"):
    """Every running agent has been observed again since an outage of netem or a stop of the world.

    An agent that is missing still has not been observed when it should have been.
    """

    after_s: float
    """Since the end of the outage [s; simulated time]."""
    missing: tuple[int, ...] = ()


class LateStart(Event, frozen=True, kw_only=True, tag="late"):
    """An agent's process had not started by the end of its boot time."""

    detail: str


AgentFaultRunEvent = ClockChanged | PoseChanged | SlowChanged | Starved
LossEvent = Killed | Left | Paused
ReturnEvent = Restarted | Joined | Resumed
LOSS_KINDS = frozenset({str(event.__struct_config__.tag) for event in get_args(LossEvent)})
RETURN_KINDS = frozenset({str(event.__struct_config__.tag) for event in get_args(ReturnEvent)})
MissionRunEvent = FormationGiven | FrameGiven
RunEvent = (
    LossEvent
    | ReturnEvent
    | RadioRunEvent
    | SensorChanged
    | AgentFaultRunEvent
    | Intruded
    | MissionRunEvent
    | SlotChanged
    | QueueChanged
    | RoleChanged
    | ControllerLogged
    | LateStart
    | WorldStopped
    | DiskFilled
    | Reconnected
)


def as_row(event: RunEvent) -> dict[str, object]:
    """Return an event as a row of events.jsonl: ``t_s``, ``kind``, ``agent``, then its own keys."""
    row: dict[str, object] = msgspec.to_builtins(event)
    first = {key: row.pop(key) for key in ("t_s", "kind", "agent")}
    return first | row


def event_of(row: object) -> RunEvent:
    """Return the event of a row. Raises msgspec.ValidationError where the row is no event."""
    event: RunEvent = msgspec.convert(row, RunEvent)
    return event
