"""Control of a running fleet by an operator: events that happen now, and reports.

Each request is checked against the present state of the fleet. A rejected request changes nothing.
An accepted one is reported in events like the timeline's own, ``by`` the operator.
"""

from collections.abc import Callable, Iterator
from typing import Any, assert_never

import msgspec
import numpy as np
import zenoh

from agent.comms.mission import last_version
from netem.faults import FaultOrder, Outage, OutageCause, RadioEvent, Sabotage
from netem.link_parameters import Conditions
from netem.wire.bus import Bus, Handler, drain
from worldsim.engine.operations import (
    AdmitAgents,
    DisturbAgents,
    EndProcesses,
    FillDisk,
    GiveMission,
    Operation,
    PauseProcesses,
    ResumeProcesses,
    SetSensorMode,
    StartProcesses,
    StopWorldProcess,
    ThrottleProcesses,
)
from worldsim.engine.step import SlotLoop
from worldsim.fleet.active_fault import ActiveFault, active_faults
from worldsim.fleet.local_socket import LocalServer
from worldsim.judge.event import By
from worldsim.judge.run_events import RunEvent
from worldsim.scenario.clock_checks import ClockErrorNow, ForeseenClocks
from worldsim.scenario.decoding import decode
from worldsim.scenario.event_checks import problem_now
from worldsim.scenario.events import EventTable
from worldsim.scenario.faults import ClockFault, Intruder, MissionChange, ProcessFault, StopWorld
from worldsim.scenario.foreseen_fleet import FleetNow
from worldsim.scenario.tables import Scenario
from worldsim.scenario.timeline import Step
from worldsim.scenario.toml import ScenarioError

MAX_REQUEST_B = 64 * 1024
REQUESTS_PER_SLOT = 4
CarryOut = Callable[[Operation, By], None]
"""Carries an operation out, and applies it to the slot loop."""


class Request(msgspec.Struct, frozen=True, forbid_unknown_fields=True, omit_defaults=True):
    """An operator's request: an event that happens now, or a report only."""

    event: dict[str, Any] | None = None
    """The event's keys without ``at_s``, not checked yet; None: only a report."""
    to: int | None = None
    """The agent that gets a mission; None: the running agent with the lowest id."""
    version: int | None = None
    """The mission's version; None: the next one."""


class Answer(msgspec.Struct, frozen=True):
    """The answer to a request that was carried out."""

    t_s: float
    """[s; simulated time]"""
    events: tuple[RunEvent, ...]
    """The events that the request caused."""
    conditions: Conditions
    """The link conditions in force afterwards."""
    faults: tuple[ActiveFault, ...]
    """The faults in force afterwards, in the order in which they began."""
    name: str | None = None
    """By which the fault that the request began can be ended; None: it began none."""


class RequestError(ValueError):
    """A rejected request; the text is the reason, in one line."""


class Control:
    """Carries out requests on a slot loop.

    launcher: whether processes can be started and ended.
    """

    def __init__(self, scenario: Scenario, loop: SlotLoop, launcher: bool) -> None:
        self._scenario = scenario
        self._loop = loop
        self._timeline = loop.effects.timeline
        self._launcher = launcher

    def answer(self, data: bytes, carry_out: CarryOut) -> Answer:
        """Carry out an encoded request. Raises RequestError."""
        request = _request(data)
        first = len(self._loop.events)
        name = None
        cause = _netem_outage_to_end(request.event)
        if cause is not None:
            self._end_outages(cause, carry_out)
        elif request.event is not None:
            event = self._event(request.event)
            if event.end is not None:
                for operation in self._ends(event.end):
                    carry_out(operation, "operator")
            else:
                step = self._timeline.begin_now(event)
                self._check_clocks(step)
                carry_out(self._operation(step, request), "operator")
                self._timeline.keep(step)
                endless = isinstance(event.action, StopWorld)  # it is over at once, or the run is
                name = event.called(step.number) if event.is_fault and not endless else None
        return self._answer(self._loop.events[first:], name)

    def _event(self, keys: dict[str, Any]) -> EventTable:
        """Return a request's event, checked against the present fleet. Raises RequestError."""
        null = _null_key(keys)
        if null is not None:
            raise RequestError(f"{null}: must be a finite number")
        try:
            event = decode({**keys, "at_s": self._loop.world.time_s}, EventTable, "")
        except ScenarioError as error:
            raise RequestError(f"{error.key}: {error.detail}") from error
        if event.name is not None and self._timeline.numbers_of(event.name):
            raise RequestError(f"name: {event.name!r} is the name of another event")
        problem = problem_now(self._scenario, event, self._fleet_now())
        if problem is not None:
            raise RequestError(": ".join(part for part in problem if part))
        by_launcher = ProcessFault | Intruder | StopWorld | Outage
        if isinstance(event.action, by_launcher) and not self._launcher:
            raise RequestError(f"{event.kind}: this fleet has no launcher; do it by hand")
        return event

    def _check_clocks(self, begins: Step) -> None:
        """Raise RequestError where a fault, with others now or later, puts a clock below 0 s."""
        if not isinstance(begins.event.action, ClockFault):
            return
        in_force = {}
        for number, errors in self._loop.world.clocks.in_force.items():
            in_force[number] = ClockErrorNow(*next(iter(errors.values())), tuple(errors))
        clocks = ForeseenClocks(self._scenario.rows, self._scenario.duration_s, in_force)
        found = clocks.first_problem(self._timeline.foreseen(begins))
        if found is not None:
            _, problem = found
            raise RequestError(f"{problem.key}: {problem.detail}")

    def _ends(self, name: str) -> Iterator[Operation]:
        """End a fault now, and all its repetitions; yield what undoes those that are in force.

        Carry out each before taking the next. Nothing is yielded where other faults hold all that
        it struck, or between two repetitions. Raises RequestError where there is nothing to end.
        """
        effects, now_s = self._loop.effects, self._loop.world.time_s
        names = self._names_to_end()
        if name not in names:
            there = ", ".join(names) or "none"
            raise RequestError(f"end: no fault {name!r} is in force; there are {there}")
        self._timeline.cancel(name)
        known = self._timeline.numbers_of(name)
        for number in effects.faults.in_force:
            if number in known:
                effects.faults.end(number, round(now_s, 6))
                operation = effects.operation(self._timeline.end_now(number, now_s))
                if operation is not None:
                    yield operation

    def _end_outages(self, cause: OutageCause, carry_out: CarryOut) -> None:
        """End every kill or pause of netem that is in force. Raises RequestError without any."""
        outages = self._loop.network.outages
        numbers = [number for number, each in outages.items() if each == cause]
        if not numbers:
            raise RequestError(f"netem: no {cause} of it is in force")
        for number in numbers:
            for operation in self._ends(self._timeline.name_of(number)):
                carry_out(operation, "operator")

    def _names_to_end(self) -> list[str]:
        """Return the names of the faults that are in force, or have begun and will happen again."""
        to_come = self._timeline.names_to_come
        begun = [
            (self._timeline.name_of(each.number), each) for each in self._loop.effects.faults.all
        ]
        names = (name for name, each in begun if each.to_s is None or name in to_come)
        return list(dict.fromkeys(names))

    def _fleet_now(self) -> FleetNow:
        effects, members = self._loop.effects, self._loop.members
        return FleetNow(
            formation=effects.missions.formation,
            frame=effects.missions.frame,
            partitioned=effects.network.partitioned,
            id_count=members.id_count,
            running=frozenset(np.flatnonzero(members.running).tolist()),
            room=self._scenario.rows - members.id_count - self._timeline.joiners,
        )

    def _operation(self, step: Step, request: Request) -> Operation:
        """Return the operation of a step now. Raises RequestError where there is nothing to do."""
        self._check_mission(step.event, request)
        operation, kind = self._loop.effects.operation(step), step.event.kind
        match operation:
            case None:
                raise RequestError(f"{kind}: nothing to do")
            case EndProcesses() | PauseProcesses() | ResumeProcesses() | DisturbAgents():
                if operation.selectors and not operation.agents:
                    selectors = list(operation.selectors)
                    raise RequestError(f"{kind}: no agent in {selectors} can do that now")
                return operation
            case StartProcesses():
                if not operation.incarnations:
                    raise RequestError(f"{kind}: {operation.refused or 'no agent to restart'}")
                return operation
            case GiveMission():
                return operation._replace(to=request.to, version=request.version)
            case FaultOrder(event=RadioEvent(sabotage=Sabotage(agents=()))):
                raise RequestError(f"{kind}: no such agent has a radio now")
            case (
                FaultOrder()
                | SetSensorMode()
                | AdmitAgents()
                | ThrottleProcesses()
                | StopWorldProcess()
                | FillDisk()
            ):
                return operation
        assert_never(operation)

    def _check_mission(self, event: EventTable, request: Request) -> None:
        """Raise RequestError where the addressee or the version of a mission is not valid."""
        if not isinstance(event.action, MissionChange):
            if (request.to, request.version) != (None, None):
                raise RequestError(f"{event.kind}: to and version go with a mission only")
            return
        members, newest = self._loop.members, self._loop.effects.missions.newest
        if request.to is not None and not 0 <= request.to < members.id_count:
            raise RequestError(f"to: no agent {request.to}; 0 to {members.id_count - 1}")
        if request.to is not None and not members.running[request.to]:
            state = members.state(request.to).value
            raise RequestError(f"to: agent {request.to} is not running ({state})")
        last = last_version(self._loop.world.time_s)
        if request.version is not None and not newest < request.version <= last:
            detail = f"{request.version}; above {newest} is allowed, up to {last} by now"
            raise RequestError(f"version: {detail}")

    def _answer(self, events: list[RunEvent], name: str | None) -> Answer:
        network = self._loop.network
        faults = tuple(active_faults(self._loop.effects.faults, self._timeline, network))
        t_s = round(self._loop.world.time_s, 6)
        return Answer(t_s, tuple(events), network.conditions, faults, name)


def _netem_outage_to_end(event: dict[str, Any] | None) -> OutageCause | None:
    """Return which outages of netem an event ends: a restart ends kills, a resume pauses."""
    if event == {"restart": ["netem"]}:
        return "kill"
    return "pause" if event == {"resume": ["netem"]} else None


def _request(data: bytes) -> Request:
    if len(data) > MAX_REQUEST_B:
        raise RequestError(f"{len(data)} B; a request has at most {MAX_REQUEST_B} B")
    try:
        return msgspec.json.decode(data, type=Request)
    except (msgspec.DecodeError, UnicodeDecodeError, RecursionError) as error:
        raise RequestError(f"malformed request: {error}") from error


def _null_key(keys: dict[str, Any]) -> str | None:
    """Return the first key whose value is null, as JSON writes NaN; None where there is none."""
    waiting: list[tuple[str, Any]] = list(keys.items())
    for path, value in waiting:
        if value is None:
            return path
        if isinstance(value, dict):
            waiting += [(f"{path}.{key}", inner) for key, inner in value.items()]
        elif isinstance(value, list):
            waiting += [(f"{path}[{at}]", inner) for at, inner in enumerate(value)]
    return None


class ControlServer:
    """Answers requests between slots, over Zenoh and, as netem may be down, over a local socket."""

    def __init__(self, bus: Bus, control: Control) -> None:
        self._control = control
        self._local = LocalServer(MAX_REQUEST_B)
        self._queries: Handler[zenoh.Query] = bus.queryable("control")

    def answer_waiting(self, carry_out: CarryOut) -> None:
        """Answer up to REQUESTS_PER_SLOT requests that have arrived in each of the two ways."""

        def answer(data: bytes) -> bytes:
            return msgspec.json.encode(self._control.answer(data, carry_out))

        self._local.answer_waiting(answer, REQUESTS_PER_SLOT)
        for query in drain(self._queries, REQUESTS_PER_SLOT):
            with query:
                data = query.payload.to_bytes() if query.payload is not None else b""
                try:
                    encoded = answer(data)
                except RequestError as error:
                    query.reply_err(str(error))
                else:
                    query.reply(query.key_expr, encoded)
