"""The faults of a run, from its events and its scenario: what struck whom, and from when to when.

It is found without the run's own reports, so that a summary can be checked against a recording.
"""

from collections.abc import Iterable, Sequence
from math import ceil, inf
from typing import Any

import msgspec

from netem.conditions import NetworkConditions
from netem.faults import Sabotage
from netem.link_parameters import Conditions
from worldsim.judge.event import By, PlannedEvent
from worldsim.judge.fault_settings import settings_of
from worldsim.judge.radio_events import (
    ConditionsChanged,
    Flapped,
    Healed,
    Jammed,
    NetemOutage,
    RadioRunEvent,
    Sabotaged,
    order_of,
)
from worldsim.judge.run_events import (
    WORKS_AGAIN,
    AgentFaultEvent,
    ClockChanged,
    DiskFilled,
    Intruded,
    Killed,
    Left,
    Paused,
    PoseChanged,
    Restarted,
    Resumed,
    RunEvent,
    SensorChanged,
    SlowChanged,
    Starved,
    WorldStopped,
)
from worldsim.scenario.faults import FaultOfEach, Kill, Leave, Pause, SensorFault
from worldsim.scenario.selectors import AllAgents, OneAgent, parsed
from worldsim.scenario.tables import Scenario
from worldsim.scenario.timeline import SLACK_S, occurrences, steps

NUMBERED = Killed | Left | Paused | SensorChanged | WorldStopped | DiskFilled
"""Events whose number an older recording lacks."""
PROCESS_KINDS = ("kill", "leave", "pause")


class FaultSpan(msgspec.Struct, kw_only=True):
    """One fault: when it began and ended, and whom it struck."""

    number: int
    kind: str
    from_s: float
    """[s; simulated time]"""
    by: By
    process: str | None = None
    agents: set[int] | None = None
    """None where a fault of its kind strikes no agents."""
    to_s: float | None = None
    held: set[int] = msgspec.field(default_factory=set)
    """Those that a fault of processes struck and that have not come back."""
    known: bool = True
    """Whether all agents are known: an operator's fault may hold some that were down before."""
    settings: dict[str, Any] | None = None
    """Of a fault of the radio, see settings_of."""

    def strike(self, agent: int | None) -> None:
        """Note that the fault ended or paused an agent's process; None: that it found none."""
        if self.agents is not None and agent is not None:
            self.agents.add(agent)
            self.held.add(agent)

    def held_with(self, others: Iterable["FaultSpan"]) -> bool:
        """Return whether other faults may hold down agents that this one does."""
        struck = (self.agents or set()) if self.kind in PROCESS_KINDS else set()
        return not self.known or any(
            other is not self
            and other.kind in PROCESS_KINDS
            and not struck.isdisjoint(other.agents or ())
            for other in others
        )

    @property
    def row(self) -> dict[str, Any]:
        """The fault under the keys of summary.json, as far as events tell of it."""
        return {
            "number": self.number,
            "kind": self.kind,
            "from_s": self.from_s,
            "to_s": self.to_s,
            "by": self.by,
            "agents": None if self.agents is None else sorted(self.agents),
            "process": self.process,
            "settings": self.settings,
        }


class FaultSpans:
    """Finds the faults of a run.

    operated: whether an operator may have injected some, or ended some; what events do not tell of
    those is left out.
    """

    def __init__(self, scenario: Scenario, *, operated: bool) -> None:
        self._operated = operated
        self._network = NetworkConditions(scenario.netem)
        self._spans: dict[int, FaultSpan] = {}
        self._ended: set[int] = set()
        """The agents that are dead or gone."""
        self._paused: set[int] = set()
        self._actions = {n: each.event.action for n, each in occurrences(scenario).items()}
        self._begins_s: dict[int, float] = {}
        self._ends_s: dict[int, float] = {}
        for step in steps(scenario):
            slot = _slot_of(step.at_s, scenario.slot_hz)
            if slot < scenario.slots:
                planned_s = self._ends_s if step.ends else self._begins_s
                planned_s[step.number] = round(slot / scenario.slot_hz, 6)

    def rows(self, events: Iterable[RunEvent]) -> dict[str, dict[str, Any]] | None:
        """Return what is known of each fault, under the keys of summary.json, by its number.

        events: of the whole run, in order. None where a fault does not tell its number, as in an
        older recording.
        """
        for event in events:
            self._end_planned(event.t_s)
            if isinstance(event, NUMBERED) and event.planned and event.number is None:
                return None
            self._take(event)
        if not self._operated:
            self._add_unseen()
        self._end_planned(inf)
        return {str(number): self._row(span) for number, span in self._spans.items()}

    def _take(self, event: RunEvent) -> None:
        if isinstance(event, RadioRunEvent):
            self._take_radio(event)
            return
        match event:
            case Killed() | Left() | Paused():
                self._lose(event)
            case Resumed(agent=int(agent)):
                self._paused.discard(agent)
                self._release(agent, ("pause",), event.t_s)
            case Resumed(number=int()) | Restarted(number=int(), refused=str()):
                self._take_idle(event)
            case Restarted(agent=int(agent)):
                self._ended.discard(agent)
                self._paused.discard(agent)
                self._release(agent, PROCESS_KINDS, event.t_s)
            case SensorChanged(number=int(number)):
                self._strike(number, event, ends=event.mode == WORKS_AGAIN)
            case ClockChanged() | PoseChanged() | SlowChanged() | Starved():
                self._strike(event.number, event, ends=event.ends)
            case Intruded() | WorldStopped() | DiskFilled():
                self._take_other(event)

    def _take_idle(self, event: Resumed | Restarted) -> None:
        """Take a return that found nobody: it begins and ends at once."""
        if event.number is not None:
            span = self._begin(event.number, event.kind, event)
            span.agents, span.to_s = set(), event.t_s

    def _take_radio(self, event: RadioRunEvent) -> None:
        match event:
            case Healed(number=number):
                for span in self._spans.values():
                    if span.kind == "partition" and number in (None, span.number):
                        self._end(span.number, event.t_s)
            case Jammed(jam=None) | Flapped(flap=None) | Sabotaged(sabotage=None):
                self._end(event.number, event.t_s)
            case NetemOutage(over=True):
                self._end(event.number, event.t_s)
            case ConditionsChanged(undone=Conditions()):
                self._end(event.number, event.t_s)
            case NetemOutage():
                self._begin(event.number, event.cause, event).process = "netem"
            case Sabotaged(sabotage=Sabotage(agents=agents)):
                self._begin(event.number, event.kind, event).agents = set(agents)
            case _:
                self._begin(event.number, event.kind, event)
        self._set(event)

    def _set(self, event: RadioRunEvent) -> None:
        """Note what a fault sets that begins, and take its effect on the conditions in force."""
        order = order_of(event)
        if order.event is not None and order.number in self._spans and order.event.heal is None:
            settings = settings_of(order, self._network.conditions)
            self._spans[order.number].settings = settings
        self._network.apply(order)

    def _take_other(self, event: Intruded | WorldStopped | DiskFilled) -> None:
        number = event.number
        if number is None:
            return
        match event:
            case Intruded(agents=None) | DiskFilled(over=True):
                self._end(number, event.t_s)
            case Intruded(agents=agents):
                self._begin(number, event.kind, event).agents = set(agents or ())
            case DiskFilled():
                self._begin(number, event.kind, event)
            case WorldStopped(cause=cause):
                span = self._begin(number, cause, event)
                span.process, span.to_s = "world", event.t_s if cause == "pause" else None

    def _lose(self, event: Killed | Left | Paused) -> None:
        down = self._paused if isinstance(event, Paused) else self._ended
        number, agent = event.number, event.agent
        if number is not None:
            if number not in self._spans:
                span = self._begin(number, event.kind, event)
                span.held = self._down_before(number, down)
                span.agents, span.known = set(span.held), not down or number in self._actions
            self._spans[number].strike(agent)
        if agent is not None:
            down.add(agent)
            if down is self._ended:
                self._paused.discard(agent)

    def _down_before(self, number: int, down: set[int]) -> set[int]:
        """Return the agents that a fault of the timeline names and that were down already."""
        action = self._actions.get(number)
        if not isinstance(action, Kill | Leave | Pause):
            return set()
        kinds = [parsed(selector) for selector in action.selectors]
        if any(isinstance(kind, AllAgents) for kind in kinds):
            return set(down)
        return down & {kind.id for kind in kinds if isinstance(kind, OneAgent)}

    def _release(self, agent: int, kinds: Sequence[str], t_s: float) -> None:
        """Note that an agent came back: the fault of the last of its agents is over."""
        for span in self._spans.values():
            if span.kind in kinds and span.to_s is None and agent in span.held:
                span.held.discard(agent)
                if not span.held:
                    span.to_s = t_s

    def _strike(self, number: int, event: SensorChanged | AgentFaultEvent, *, ends: bool) -> None:
        if ends:
            self._end(number, event.t_s)
            return
        span = self._begin(number, event.kind, event)
        span.agents = set() if span.agents is None else span.agents
        if event.agent is not None:
            span.agents.add(event.agent)

    def _begin(self, number: int, kind: str, event: PlannedEvent | ConditionsChanged) -> FaultSpan:
        new = FaultSpan(number=number, kind=kind, from_s=event.t_s, by=event.by)
        return self._spans.setdefault(number, new)

    def _end(self, number: int, t_s: float) -> None:
        span = self._spans.get(number)
        if span is not None and span.to_s is None:
            span.to_s = t_s

    def _end_planned(self, until_s: float) -> None:
        """End the faults whose time is over, though no event tells of it."""
        for number, span in self._spans.items():
            ends_s = self._ends_s.get(number, inf)
            if ends_s <= until_s and ends_s < inf:
                self._end(number, max(ends_s, span.from_s))

    def _add_unseen(self) -> None:
        """Add the faults of the timeline that found no agent, and so made no event."""
        for number, from_s in self._begins_s.items():
            action = self._actions[number]
            if number not in self._spans and isinstance(action, FaultOfEach | SensorFault):
                kind = "sensor" if isinstance(action, SensorFault) else action.kind
                self._spans[number] = FaultSpan(
                    number=number, kind=kind, from_s=from_s, by=None, agents=set()
                )

    def _row(self, span: FaultSpan) -> dict[str, Any]:
        """Return what is known of a fault.

        An operator may end a fault whose agents others hold down: no event tells of that.
        """
        row = span.row
        if not span.known:
            del row["agents"]
        if self._operated and span.held_with(self._spans.values()):
            del row["to_s"]
        return row


def _slot_of(at_s: float, slot_hz: float) -> int:
    """Return the first slot that is due at a time, or after it [s]."""
    return ceil((at_s - SLACK_S) * slot_hz - SLACK_S)
