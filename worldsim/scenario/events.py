"""The timeline's tables: what happens to a fleet while it flies.

An event is one action at one time. What must hold between events is said in ``course``.
"""

from typing import Annotated, Literal

from msgspec import Meta

from agent.config import Positive, Table
from agent.qstructure.formation import FormationSpec
from netem.link_keys import Conditions
from netem.messages import Jam
from worldsim.scenario.radio_faults import FlapTable, Groups, PartitionTable
from worldsim.scenario.start import BoxStart, ListStart
from worldsim.scenario.target_frame import FrameChange, Time

Selector = Annotated[
    int | str,
    Meta(description="an id, 'vertex:V1', 'queue:Q1', 'random:2' or 'all'"),
]
Selectors = Annotated[tuple[Selector, ...], Meta(min_length=1, max_length=1000)]
Joiners = Annotated[int, Meta(ge=1, le=1000)]


class JoinTable(Table, frozen=True):
    """How many join, and where; ``start`` left out is that of [fleet]."""

    count: Joiners
    start: BoxStart | ListStart | None = None


class SensorFault(Table, frozen=True):
    """Whose sensor fails, and how; ``kind`` left out: every sensor that they have.

    stuck: it tells its last reading for ever; silent: nothing; wrong: anything.
    """

    agents: Selectors
    mode: Literal["stuck", "silent", "wrong"]
    kind: Literal["proximity", "laser", "sonar"] | None = None


class EventTable(Table, frozen=True):
    """One action at ``at_s``; ``for_s`` later it is undone, where it can be.

    kill: processes die, their vehicles stop and hover; leave: the vehicles go too; restart: they
    come back; join: new ones come, under the next free ids. pause: processes are stopped, their
    vehicles hover when the last command has expired; resume: they go on. partition: groups that
    hear only themselves, agents not named form one more, or a table for other kinds; heal ends it.
    jam: a sphere where no radio works; flap: links that go down and up. netem: keys of [netem] that
    change. sensor: sensors fail. formation, frame: a mission for the team.
    """

    at_s: Time
    for_s: Positive | None = None
    kill: Selectors | None = None
    leave: Selectors | None = None
    restart: Selectors | None = None
    pause: Selectors | None = None
    resume: Selectors | None = None
    join: Joiners | JoinTable | None = None
    partition: Groups | PartitionTable | None = None
    heal: bool | None = None
    jam: Jam | None = None
    flap: FlapTable | None = None
    netem: Conditions | None = None
    sensor: SensorFault | None = None
    formation: FormationSpec | None = None
    frame: FrameChange | None = None

    @property
    def actions(self) -> list[str]:
        """The actions that are given; a sound event has one."""
        return [name for name in ACTIONS if getattr(self, name) is not None]

    @property
    def kind(self) -> str:
        """The event's own key: its action."""
        return self.actions[0]

    @property
    def joiners(self) -> int:
        """How many agents join by this event."""
        if self.join is None:
            return 0
        return self.join.count if isinstance(self.join, JoinTable) else self.join

    @property
    def start(self) -> BoxStart | ListStart | None:
        """Where its joiners start, if it is not where the fleet did."""
        return self.join.start if isinstance(self.join, JoinTable) else None

    @property
    def selectors(self) -> tuple[int | str, ...]:
        """Whom an action upon processes is about."""
        return self.kill or self.leave or self.restart or self.pause or self.resume or ()


ACTIONS = tuple(name for name in EventTable.__struct_fields__ if name not in {"at_s", "for_s"})
UNDONE = ("kill", "leave", "pause", "partition", "jam", "flap", "netem", "sensor")
"""Actions that ``for_s`` can undo."""
UPON_PROCESSES = ("kill", "leave", "restart", "join", "pause", "resume")
"""Actions that need somebody who starts and signals processes."""
