"""What each fault of a run did: when it began and ended, and what it struck.

A fault that strikes nothing proves nothing of the fleet, however well the run ends.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from typing import Any

from netem.faults import FaultOrder, Heal, RadioEvent
from netem.link_parameters import Conditions
from worldsim.engine.operations import (
    DisturbAgents,
    EndProcesses,
    FillDisk,
    Operation,
    PauseProcesses,
    ResumeProcesses,
    SetSensorMode,
    StartProcesses,
    StopWorldProcess,
)
from worldsim.judge.event import By
from worldsim.judge.fault_settings import settings_of
from worldsim.scenario.selectors import ProcessName


class FaultReport:
    """One fault of a run.

    number: of its event, as in events.jsonl; kind: the event's key; from_s: when it began [s];
    to_s: when it ended [s], None while it is in force; agents: those that it struck, ascending;
    process: netem's or the world's, of a fault that struck that one. observations: how many did not
    pass while netem was down; stopped_s: how long the world stood still [s; wall time], None where
    no process was stopped; writes: how many failed. settings: the keys of a fault of the radio; of
    a change of the conditions each with its value before and after, as "from" and "to".
    """

    def __init__(
        self,
        number: int,
        kind: str,
        from_s: float,
        by: By,
        agents: Sequence[int],
        process: ProcessName | None = None,
    ) -> None:
        self.number, self.kind, self.from_s, self.by = number, kind, from_s, by
        self.agents = sorted(agents)
        self.process = process
        self.to_s: float | None = None
        self.observations = self.writes = 0
        self.stopped_s: float | None = None
        self.settings: Mapping[str, Any] = {}
        self._held = set(agents)

    def release(self, agents: Collection[int], t_s: float) -> None:
        """Note that some agents came back at a time [s]: the fault of the last of them is over."""
        if self.to_s is None and not self._held.isdisjoint(agents):
            self._held.difference_update(agents)
            if not self._held:
                self.to_s = t_s

    @property
    def held(self) -> tuple[int, ...]:
        """The agents that it strikes still, in ascending order."""
        return tuple(sorted(self._held))

    @property
    def on_radio(self) -> bool:
        """Whether it strikes frames, not agents."""
        return self.kind in RadioEvent.__struct_fields__


class FaultReports:
    """The faults of a run so far, in the order in which they began."""

    def __init__(self) -> None:
        self.all: list[FaultReport] = []

    @property
    def in_force(self) -> list[int]:
        """The numbers of the faults that have not ended, in the order in which they began."""
        return [each.number for each in self.all if each.to_s is None]

    def of_kind(self, kind: str) -> list[FaultReport]:
        """Return the faults of a kind, in the order in which they began."""
        return [each for each in self.all if each.kind == kind]

    def take(self, operation: Operation, t_s: float, by: By, conditions: Conditions) -> None:
        """Take an operation that was carried out at a time [s]: it may begin a fault, or end some.

        conditions: of the radio, before it. Agents that an earlier fault holds down are struck too:
        this one may hold them for longer.
        """
        self._take_stop(operation, t_s, by)
        match operation:
            case EndProcesses():
                kind = "leave" if operation.leaves else "kill"
                agents = operation.agents + operation.ended_before
            case PauseProcesses():
                kind, agents = "pause", operation.agents + operation.paused_before
            case SetSensorMode() if operation.mode is not None:
                kind, agents = "sensor", operation.agents
            case DisturbAgents(ends=False):
                kind, agents = operation.fault.kind, operation.agents
            case FaultOrder(fault=Heal()):
                self._end([each for each in self.all if each.kind == "partition"], t_s)
                return
            case ResumeProcesses() | StartProcesses():
                self._take_return(operation, t_s, by)
                return
            case FaultOrder(event=event) if event is not None:
                kind, agents = event.radio_kind, event.victims
            case _:
                return
        report = FaultReport(operation.number, kind, t_s, by, agents)
        if isinstance(operation, FaultOrder):
            report.settings = settings_of(operation, conditions)
        self.all.append(report)

    def _take_return(self, operation: ResumeProcesses | StartProcesses, t_s: float, by: By) -> None:
        """Take a return of agents: it ends faults, or is an idle one where there is nobody."""
        if isinstance(operation, ResumeProcesses):
            self._release(operation.agents, ("pause",), t_s)
            kind, idle = "resume", not operation.agents
        else:
            self._release(operation.incarnations, ("kill", "leave", "pause"), t_s)
            kind, idle = operation.kind, not operation.incarnations and operation.refused is None
        if idle:
            report = FaultReport(operation.number, kind, t_s, by, ())
            report.to_s = t_s
            self.all.append(report)

    def _take_stop(self, operation: Operation, t_s: float, by: By) -> None:
        """Take the beginning of a fault of netem's processes or the world's."""
        match operation:
            case StopWorldProcess(number=number, cause=cause):
                report = FaultReport(number, cause, t_s, by, (), "world")
                # The world's clock stands still meanwhile: by it a pause takes no time.
                report.to_s = t_s if cause == "pause" else None
                self.all.append(report)
            case FillDisk(number=number, full=True):
                self.all.append(FaultReport(number, "disk_full", t_s, by, ()))
            case FaultOrder(number=number, outage=cause) if cause is not None:
                self.all.append(FaultReport(number, cause, t_s, by, (), "netem"))

    def withhold(self, numbers: Collection[int], observations: int) -> None:
        """Note that the outages of these numbers kept observations from their agents."""
        for each in self.all:
            if each.number in numbers:
                each.observations += observations

    def note_writes(self, number: int, failed: int) -> None:
        """Note that writes failed while a fault of this number let the disk be full."""
        for each in self.all:
            if each.number == number:
                each.writes += failed

    def note_standstill(self, number: int, stopped_s: float) -> None:
        """Note that the world stood still for a pause [s; wall time]."""
        for each in self.all:
            if each.number == number:
                each.stopped_s = (each.stopped_s or 0.0) + stopped_s

    def end(self, number: int, t_s: float) -> None:
        """Note that the time of a fault is over [s]; its agents may be held down by others."""
        self._end([each for each in self.all if each.number == number], t_s)

    def _release(self, agents: Collection[int], kinds: Sequence[str], t_s: float) -> None:
        for each in self.all:
            if each.kind in kinds:
                each.release(agents, t_s)

    def _end(self, faults: Sequence[FaultReport], t_s: float) -> None:
        for each in faults:
            if each.to_s is None:
                each.to_s = t_s
