"""The timeline's table: an event is one action at one time.

``event_checks`` checks events against each other.
"""

from typing import Annotated

from msgspec import Meta

from agent.config import Positive
from agent.qstructure.formation import FormationSpec
from netem.faults import Outage, OutageCause, RadioKeys
from worldsim.scenario.faults import (
    Action,
    AgentFault,
    ClockFault,
    DiskFull,
    EndFault,
    Intruder,
    Join,
    Joiners,
    Kill,
    Leave,
    Pause,
    PoseFault,
    ProcessFault,
    Restart,
    Resume,
    SabotageFault,
    SensorFault,
    SlowFault,
    StarveFault,
    StopWorld,
)
from worldsim.scenario.selectors import (
    ProcessName,
    ReturningSelectors,
    Selectors,
    StoppableSelectors,
    other_process,
)
from worldsim.scenario.target_frame import FrameChange, Time

Name = Annotated[
    str,
    Meta(
        pattern=r"^[A-Za-z0-9][A-Za-z0-9._-]*\Z",
        max_length=80,
        description="a name of letters, digits, '.', '_' and '-', at most 80, no '.' first",
    ),
]
"""A name of a run or of an event."""


class EventTable(RadioKeys[SabotageFault], frozen=True, kw_only=True, omit_defaults=False):
    """One action at ``at_s``; ``for_s`` undoes it after that time, where it can be undone.

    every_s: what can be undone happens again after this time, to the end of the run.
    kill: ends processes, the vehicles stop and hover; leave: the vehicles leave the world too;
    restart: starts such agents again; join: adds new agents, under the next free ids. pause: stops
    processes, the vehicles hover when the last command has expired; resume: continues them. kill
    and pause of ["netem"], the radio and router, or of ["world"] stop those processes.
    partition: cuts the links between groups, unnamed agents form one more; a table for other kinds;
    heal: ends all partitions. jam: a sphere in which no radio works; flap: links that go down and
    up. netem: changes keys of [netem]. sabotage: somebody sends frames by agents' radios.
    sensor: lets sensors fail.
    clock: agents' clocks are wrong.
    disk_full: nothing more of recording and events can be written.
    pose: agents measure their poses wrong.
    starve: agents' processes run only for a share of each period.
    slow: each step of agents takes a time; meanwhile they hear nothing, and they answer late.
    intruder: a process outside the fleet attacks its router.
    end: ends a fault by its name, which is its kind and the event's index, as in "jam-2", unless
    ``name`` gives another one. formation, frame: a mission for the team.
    """

    at_s: Time
    for_s: Positive | None = None
    every_s: Positive | None = None
    name: Name | None = None
    kill: StoppableSelectors | None = None
    leave: Selectors | None = None
    restart: ReturningSelectors | None = None
    pause: StoppableSelectors | None = None
    resume: ReturningSelectors | None = None
    join: Joiners | Join | None = None
    sensor: SensorFault | None = None
    clock: ClockFault | None = None
    disk_full: bool | None = None
    pose: PoseFault | None = None
    slow: SlowFault | None = None
    starve: StarveFault | None = None
    intruder: Intruder | None = None
    end: str | None = None
    formation: FormationSpec | None = None
    frame: FrameChange | None = None

    @property
    def keys(self) -> list[str]:
        """The keys of the actions that are set; a valid event has one."""
        return [name for name in ACTIONS if getattr(self, name) is not None]

    @property
    def kind(self) -> str:
        """The event's own key: its action."""
        return self.keys[0]

    @property
    def is_fault(self) -> bool:
        """Whether the event strikes something; missions, and what only undoes a fault, do not."""
        return any(key in FAULTS for key in self.keys)

    @property
    def action(self) -> Action:
        """The action whose key is set. Raises LookupError without one."""
        of_agents = self.sensor or self.sabotage or self.agent_fault
        fault = self.radio_fault or self._stop or self._process_fault or of_agents
        action = fault or self.formation or self.frame or self._of_run
        if action is None:
            raise LookupError("the event has no action")
        return action

    @property
    def agent_fault(self) -> AgentFault | None:
        """The fault of single agents whose key is set; None where there is none."""
        return self.clock or self.pose or self.slow or self.starve or self.intruder

    def called(self, number: int) -> str:
        """Return the event's name. number: its index, or the number of an operator's event."""
        return self.name or f"{self.kind}-{number}"

    @property
    def process(self) -> ProcessName | None:
        """The process of no agent that the event stops; None: it does not."""
        return other_process(self.kill or self.pause or ())

    @property
    def _stop(self) -> Outage | StopWorld | None:
        """The fault of netem's processes, or of the world's."""
        cause: OutageCause = "kill" if self.kill is not None else "pause"
        match self.process:
            case "netem":
                return Outage(cause)
            case "world":
                return StopWorld(cause, self.for_s)
        return None

    @property
    def _of_run(self) -> DiskFull | EndFault | None:
        if self.disk_full:
            return DiskFull()
        return EndFault(self.end) if self.end is not None else None

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
        """Number of agents that join by this event."""
        return self.join.count if isinstance(self.join, Join) else self.join or 0


_NO_ACTIONS = ("at_s", "for_s", "every_s", "name")
_RADIO = RadioKeys.__struct_fields__
_OTHERS = (key for key in EventTable.__struct_fields__ if key not in (*_NO_ACTIONS, *_RADIO))
ACTIONS = (*_OTHERS, *_RADIO)
"""The keys of all actions."""
_LASTING = tuple(key for key in _RADIO if key != "heal")
_OF_AGENTS = (
    "clock",
    "pose",
    "slow",
    "starve",
    "intruder",
)
UNDOABLE = ("kill", "leave", "pause", *_LASTING, "sensor", *_OF_AGENTS, "disk_full")
"""The keys of the actions that ``for_s`` can undo."""
FAULTS = UNDOABLE
"""The keys of the actions that are faults: each of them can be undone."""
