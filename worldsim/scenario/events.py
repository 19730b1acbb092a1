"""The timeline's tables: what happens to a fleet while it flies.

An event is one action at one time. ``event_checks`` says what must hold between events.
"""

from agent.config import Positive
from agent.qstructure.formation import FormationSpec
from netem.faults import RadioEvent
from worldsim.scenario.faults import (
    Action,
    Join,
    Joiners,
    Kill,
    Leave,
    Pause,
    ProcessFault,
    Restart,
    Resume,
    SensorFault,
)
from worldsim.scenario.selectors import Selectors
from worldsim.scenario.target_frame import FrameChange, Time


class EventTable(RadioEvent, frozen=True, kw_only=True, omit_defaults=False):
    """One action at ``at_s``; ``for_s`` later it is undone, where it can be.

    kill: processes die, their vehicles stop and hover; leave: the vehicles go too; restart: they
    come back; join: new ones come, under the next free ids. pause: processes are stopped, their
    vehicles hover once the last command has expired; resume: they go on. partition: groups that
    hear only themselves, unnamed agents form one more, or a table for other kinds; heal ends it.
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
    join: Joiners | Join | None = None
    sensor: SensorFault | None = None
    formation: FormationSpec | None = None
    frame: FrameChange | None = None

    @property
    def keys(self) -> list[str]:
        """The keys of the actions that are given; a valid event has one."""
        return [name for name in ACTIONS if getattr(self, name) is not None]

    @property
    def kind(self) -> str:
        """The event's own key: its action."""
        return self.keys[0]

    @property
    def action(self) -> Action:
        """The action that is given. Raises LookupError without one."""
        fault = self.radio_fault or self._process_fault or self.sensor
        action = fault or self.formation or self.frame
        if action is None:
            raise LookupError("an event without an action")
        return action

    @property
    def _process_fault(self) -> ProcessFault | None:
        for kind, selectors in (
            (Kill, self.kill),
            (Leave, self.leave),
            (Restart, self.restart),
            (Pause, self.pause),
            (Resume, self.resume),
        ):
            if selectors is not None:
                return kind(selectors)
        return Join(count=self.join) if isinstance(self.join, int) else self.join

    @property
    def joiners(self) -> int:
        """How many agents join by this event."""
        return self.join.count if isinstance(self.join, Join) else self.join or 0

    @property
    def selectors(self) -> Selectors:
        """The agents that an action on processes selects; empty for other actions."""
        return self.kill or self.leave or self.restart or self.pause or self.resume or ()


_TIMES = ("at_s", "for_s")
_RADIO = RadioEvent.__struct_fields__
_OTHERS = (key for key in EventTable.__struct_fields__ if key not in (*_TIMES, *_RADIO))
ACTIONS = (*_OTHERS, *_RADIO)
UNDONE = ("kill", "leave", "pause", "partition", "jam", "flap", "netem", "sensor")
"""Actions that ``for_s`` can undo."""
ON_PROCESSES = ("kill", "leave", "restart", "join", "pause", "resume")
"""Actions that need a launcher, which starts and signals processes."""
