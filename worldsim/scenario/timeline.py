"""The timeline: what is due when, as typed actions. Pure; the same for every clock.

An action says what shall happen; whom it strikes is found when it happens (``team``), and becomes a
deed that a clock carries out.
"""

from bisect import insort
from math import inf
from typing import Literal, NamedTuple

from agent.messages import FramePath
from agent.qstructure.formation import FormationSpec
from netem.link_keys import Conditions
from netem.messages import (
    Changed,
    Flap,
    Flapped,
    Groups,
    Healed,
    Jam,
    Jammed,
    Parted,
    PartitionKind,
)
from netem.schedule import overlaid
from worldsim.scenario.event_checks import Step, steps
from worldsim.scenario.events import EventTable, SensorFault
from worldsim.scenario.radio_faults import partition_of
from worldsim.scenario.start import BoxStart, ListStart
from worldsim.scenario.tables import Scenario
from worldsim.scenario.target_frame import changed, path_of

SLACK_S = 1e-9


class Strike(NamedTuple):
    """Agents are to go; ``kind``: kill leaves their vehicles hovering, leave takes them away."""

    number: int
    kind: str
    selectors: tuple[int | str, ...]


class Revival(NamedTuple):
    """Agents are to come back: those selected, or with none selected those struck by ``number``."""

    number: int
    selectors: tuple[int | str, ...]


class Holding(NamedTuple):
    """Processes are to be stopped (kind pause), or to go on (resume): those selected.

    With none selected, those go on that ``number`` stopped.
    """

    number: int
    kind: str
    selectors: tuple[int | str, ...]


class Failing(NamedTuple):
    """Sensors are to fail, those of a kind or all; with no mode, those ``number`` struck work."""

    number: int
    selectors: tuple[int | str, ...]
    sensor: str | None
    mode: Literal["stuck", "silent", "wrong"] | None


class Joining(NamedTuple):
    """New agents are to come."""

    number: int
    joiners: int
    start: BoxStart | ListStart


class Change(NamedTuple):
    """The radio's conditions from now on; ``undone``: whether a change ends by it."""

    conditions: Conditions
    change: Conditions
    undone: bool

    @property
    def order(self) -> Changed:
        """What the medium is told."""
        return Changed(self.conditions)


class Partition(NamedTuple):
    """The radio's groups from now on, parted in a way; ``bridge``: whom all hear."""

    groups: Groups
    parted: PartitionKind = "clean"
    bridge: tuple[int, ...] = ()

    @property
    def order(self) -> Parted:
        """What the medium is told."""
        return Parted(self.groups, self.parted, self.bridge)


class Heal(NamedTuple):
    """No groups from now on."""

    @property
    def order(self) -> Healed:
        """What the medium is told."""
        return Healed()


class Jamming(NamedTuple):
    """A jam from now on, or with None its end; ``number`` tells it from others."""

    number: int
    jam: Jam | None

    @property
    def order(self) -> Jammed:
        """What the medium is told."""
        return Jammed(self.number, self.jam)


class Flapping(NamedTuple):
    """Links that flap from now on, or with None their end; ``number`` tells them from others."""

    number: int
    flap: Flap | None

    @property
    def order(self) -> Flapped:
        """What the medium is told."""
        return Flapped(self.number, self.flap)


class Order(NamedTuple):
    """What the team shall form from now on, and where its frame goes.

    kind: formation or frame, what is new. to: whom it is given to, None the lowest id; version: its
    own, None the next.
    """

    kind: str
    formation: FormationSpec
    path: FramePath
    to: int | None = None
    version: int | None = None


UponRadio = Change | Partition | Heal | Jamming | Flapping
"""What the medium carries out: each has its ``order``."""
BARRIERS = {Partition: "partition", Heal: "heal", Jamming: "jam", Flapping: "flap"}
"""Of these, what lets frames across or not, and the kind of event that each is."""
Action = Strike | Revival | Holding | Failing | Joining | UponRadio | Order


class Timeline:
    """A scenario's events in order of their times, and an operator's as they come.

    formation, frame: those that the last mission asked for.
    """

    def __init__(self, scenario: Scenario) -> None:
        self._steps = steps(scenario)
        self._next = 0
        self._fleet_start = scenario.fleet.start
        self._conditions = scenario.netem
        self._changes: dict[int, Conditions] = {}
        self._parted_by: int | None = None
        self._number = len(scenario.event)
        self.formation = scenario.formation
        self.frame = scenario.frame

    @property
    def next_s(self) -> float:
        """When the next action is due [s]; infinite after the last."""
        return self._steps[self._next].at_s if self._next < len(self._steps) else inf

    @property
    def conditions(self) -> Conditions:
        """The radio's conditions: the scenario's, under all changes in force."""
        conditions = self._conditions
        for held in self._changes.values():
            conditions = overlaid(conditions, held)
        return conditions

    @property
    def parted(self) -> bool:
        """Whether a partition is in force."""
        return self._parted_by is not None

    @property
    def joiners(self) -> int:
        """How many are still to join by the events to come."""
        return sum(step.event.joiners for step in self._steps[self._next :] if not step.undo)

    def sudden(self, event: EventTable) -> Action | None:
        """Return the action of an event that happens now, at its ``at_s``."""
        self._number += 1
        return self._action(Step(event.at_s, self._number, event, False))

    def undo_later(self, event: EventTable) -> None:
        """Let the last sudden event be undone after its ``for_s``, if it has one."""
        if event.for_s is not None:
            step = Step(event.at_s + event.for_s, self._number, event, True)
            insort(self._steps, step, lo=self._next, key=lambda each: each.at_s)

    def due(self, time_s: float) -> list[Action]:
        """Return what is due by a time [s] and was not returned before, in order."""
        actions = []
        while self.next_s <= time_s + SLACK_S:
            action = self._action(self._steps[self._next])
            self._next += 1
            if action is not None:
                actions.append(action)
        return actions

    def _action(self, step: Step) -> Action | None:
        event = step.event
        if event.netem is not None:
            return self._change(step, event.netem)
        if event.partition is not None or event.heal is not None:
            return self._partition(step)
        if event.jam is not None or event.flap is not None:
            return _barrier(step)
        if event.formation is not None or event.frame is not None:
            return self._order(event)
        if event.joiners:
            return Joining(step.number, event.joiners, event.start or self._fleet_start)
        return _failing(step, event.sensor) if event.sensor is not None else _upon_agents(step)

    def _change(self, step: Step, change: Conditions) -> Change:
        """Lay the changes in force over the scenario's conditions, the later over the earlier."""
        if step.undo:
            del self._changes[step.number]
        else:
            self._changes[step.number] = change
        return Change(self.conditions, change, step.undo)

    def _partition(self, step: Step) -> Partition | Heal | None:
        """Let a partition take the place of the one before; only its own end heals it."""
        if step.event.partition is not None and not step.undo:
            self._parted_by = step.number
            table = partition_of(step.event.partition)
            return Partition(table.groups, table.kind, table.bridge)
        if step.undo and self._parted_by != step.number:
            return None
        self._parted_by = None
        return Heal()

    def _order(self, event: EventTable) -> Order:
        if event.formation is not None:
            self.formation = event.formation
        if event.frame is not None:
            self.frame = changed(self.frame, event.frame, event.at_s)
        return Order(event.kind, self.formation, path_of(self.frame))


def _barrier(step: Step) -> Jamming | Flapping:
    event = step.event
    if event.flap is not None:
        return Flapping(step.number, None if step.undo else event.flap.from_s(event.at_s))
    return Jamming(step.number, None if step.undo else event.jam)


def _failing(step: Step, fault: SensorFault) -> Failing:
    if step.undo:
        return Failing(step.number, (), fault.kind, None)
    return Failing(step.number, fault.agents, fault.kind, fault.mode)


def _upon_agents(step: Step) -> Strike | Revival | Holding:
    """Return what becomes of agents; what undoes a step is about those whom it struck."""
    kind, selectors = step.event.kind, () if step.undo else step.event.selectors
    if kind in {"pause", "resume"}:
        return Holding(step.number, "resume" if step.undo else kind, selectors)
    if step.undo or kind == "restart":
        return Revival(step.number, selectors)
    return Strike(step.number, kind, selectors)
