"""What happens in a run, as typed events: one line each of events.jsonl and of the recording.

``kind`` is the event's own key. The judge, the recorder and readers of a run see the same events.
"""

from typing import Any, Literal, get_args

import msgspec

from agent.messages import FramePath
from agent.qstructure.formation import FormationSpec
from netem.faults import Flap, Group, Jam, PartitionKind
from netem.link_keys import Conditions

By = Literal["operator"] | None
"""Who asked for an event; None: the timeline."""


class Event(
    msgspec.Struct, frozen=True, kw_only=True, omit_defaults=True, tag_field="kind", gc=False
):
    """Something that happened at a time, to one agent or to none in particular."""

    t_s: float
    """[s; simulated time]"""
    agent: int | None

    @property
    def kind(self) -> str:
        """The event's key."""
        return str(self.__struct_config__.tag)


class PlannedEvent(Event, frozen=True, kw_only=True):
    """An event that the timeline, an operator or an accident caused."""

    planned: bool
    """False for an accident."""
    by: By = None


class ProcessEvent(PlannedEvent, frozen=True, kw_only=True):
    """A change of an agent's process, or of no process where none was selected."""

    nobody: tuple[int | str, ...] | None = None
    """The selectors, where they mean no agent."""


class Killed(ProcessEvent, frozen=True, tag="kill"):
    """An agent's process ended; its vehicle hovers."""

    signal: int | None = None
    """By which it ended, where that was not planned."""
    status: int | None = None
    """With which it ended, where that was not planned."""


class Left(ProcessEvent, frozen=True, tag="leave"):
    """An agent's process ended, and its vehicle left the world."""


class Paused(ProcessEvent, frozen=True, tag="pause"):
    """An agent's process was stopped."""


class Resumed(ProcessEvent, frozen=True, tag="resume"):
    """An agent's stopped process goes on."""


class StartEvent(PlannedEvent, frozen=True, kw_only=True):
    """An agent's process started, or none where that was refused."""

    incarnation: int | None = None
    refused: str | None = None
    """Why no process starts."""


class Restarted(StartEvent, frozen=True, tag="restart"):
    """An agent that had died or left comes back."""


class Joined(StartEvent, frozen=True, tag="join"):
    """A new agent comes."""


class RadioFaultEvent(PlannedEvent, frozen=True, kw_only=True):
    """A fault of the radio began or ended; ``number`` identifies it."""

    number: int


class Partitioned(RadioFaultEvent, frozen=True, kw_only=True, tag="partition"):
    """A partition began."""

    groups: tuple[Group, ...]
    parted: PartitionKind
    bridge: tuple[int, ...]


class Healed(PlannedEvent, frozen=True, kw_only=True, tag="heal"):
    """A partition ended, or all of them."""

    number: int | None = None
    """Of the one that ended; None: all."""


class Jammed(RadioFaultEvent, frozen=True, kw_only=True, tag="jam"):
    """A jam began, or ended."""

    jam: Jam | None
    """None: it ended."""


class FlapWindow(Flap, frozen=True):
    """A flap and its start [s; simulated time]."""

    from_s: float = 0.0


class Flapped(RadioFaultEvent, frozen=True, kw_only=True, tag="flap"):
    """Links began to flap, or stopped."""

    flap: FlapWindow | None
    """None: they stopped."""


class ConditionsChanged(
    Conditions, frozen=True, kw_only=True, omit_defaults=True, tag_field="kind", tag="netem"
):
    """Link conditions changed: by its own link keys, or back where a change is ``undone``."""

    t_s: float
    agent: int | None
    planned: bool
    by: By = None
    number: int
    conditions: Conditions
    """All that hold from now on."""
    undone: Conditions | None = None

    @property
    def kind(self) -> str:
        """The event's key."""
        return "netem"


class SensorChanged(PlannedEvent, frozen=True, kw_only=True, tag="sensor"):
    """An agent's sensor fails, or works again."""

    sensor: str
    """Its kind, or "all"."""
    mode: str
    """stuck, silent, wrong, or "works again"."""


class MissionEvent(PlannedEvent, frozen=True, kw_only=True):
    """A mission was given to an agent."""

    formation: str
    """Its name."""
    mission: int
    """The mission's key."""
    path: FramePath
    tables: FormationSpec


class FormationGiven(MissionEvent, frozen=True, tag="formation"):
    """A mission with a new formation."""


class FrameGiven(MissionEvent, frozen=True, tag="frame"):
    """A mission with a new frame."""


class SlotChanged(Event, frozen=True, kw_only=True, tag="slot"):
    """An agent claims another place, as queue and rank."""

    place: tuple[int, int] | None
    before: tuple[int, int] | None


class QueueChanged(Event, frozen=True, kw_only=True, tag="queue"):
    """An agent is in another queue."""

    queue: int | None


class RoleChanged(Event, frozen=True, kw_only=True, tag="role"):
    """An agent became a vertex agent, or is none any more."""

    role: Literal["vertex", "member"]


class LateStart(Event, frozen=True, kw_only=True, tag="late"):
    """An agent's process is not up by the end of its boot time."""

    detail: str


RadioRunEvent = Partitioned | Healed | Jammed | Flapped | ConditionsChanged
LossEvent = Killed | Left | Paused
ReturnEvent = Restarted | Joined | Resumed
LOSS_KINDS = frozenset({str(event.__struct_config__.tag) for event in get_args(LossEvent)})
MissionRunEvent = FormationGiven | FrameGiven
RunEvent = (
    LossEvent
    | ReturnEvent
    | RadioRunEvent
    | SensorChanged
    | MissionRunEvent
    | SlotChanged
    | QueueChanged
    | RoleChanged
    | LateStart
)


def as_row(event: RunEvent) -> dict[str, Any]:
    """Return an event as plain data, ``t_s``, ``kind`` and ``agent`` first."""
    row: dict[str, Any] = msgspec.to_builtins(event)
    first = {key: row.pop(key) for key in ("t_s", "kind", "agent")}
    return first | row


def event_of(row: Any) -> RunEvent:
    """Return the event of a row. Raises msgspec.ValidationError where it is none."""
    event: RunEvent = msgspec.convert(row, RunEvent)
    return event
